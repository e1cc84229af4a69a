"""A field to triangles: over a whole box, or continued from seeds where the surface is.

`polygonize`         samples on a lattice to triangles
`boxed_lattice`      a lattice that ends on the faces of a box
`level_samples`      samples, rough where their side is certain
`caps`               caps that close a surface on those faces
`crease_edges`       sharp edges between tangent planes
`band`               vertices and triangles in the cells that a surface crosses
`octree`             the same in cells as wide as the data around ask for
`continuation`       a surface followed from seeds
`remembered`         a field that is asked for its gradient once at each place
`isosurface`         `extract_isosurface`: any field, over a box or from seeds
`cell_loops`         one cell: marching cubes and tetrahedra
`polygonize_loops`   a lattice, plane by plane
`remembered_loops`   places in a hash table
`crease_edge_loops`  fans about new vertices on sharp edges
"""
