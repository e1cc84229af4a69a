"""The cells of a lattice that a surface crosses, followed from cell to cell.

`band`           cells that grow across the faces a surface crosses
`band_surface`   vertices and triangles in those cells
`band_loops`     cells by the rows of their corners
`morton_loops`   points of the lattice in a hash table
"""
