"""A field to triangles: over a whole box, or continued from seeds where the surface is.

`polygonise`         samples on a lattice to triangles
`isosurface`         any field over a box
`wavefront`          cells that grow across the faces a surface crosses
`crease_edges`       sharp edges between tangent planes
`band`               any field, continued from seeds
`cell_loops`         one cell: marching cubes and tetrahedra
`polygonise_loops`   a lattice, plane by plane
`band_loops`         cells in a hash table
`crease_edge_loops`  fans about new vertices on sharp edges
"""
