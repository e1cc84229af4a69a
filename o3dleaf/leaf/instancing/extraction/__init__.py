"""One period of a field to a tile: sampled, its voids filled, and polygonized, slab by slab.

`tile_cost`     memory and time that it takes
`samples`       samples of the field, and what is inside by them
`slab_surface`  the surface in slabs of planes, and all of them as one
`sharpened`     vertices where the field itself is zero
`extract`       all of it
"""
