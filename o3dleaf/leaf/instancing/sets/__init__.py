"""Several tiles of one lattice, of which each place has one, or parts of two.

`tile_set`   tiles whose borders match, polygonized together once
`mixed_tile` cells from one tile, and from another one that agrees with it elsewhere
"""
