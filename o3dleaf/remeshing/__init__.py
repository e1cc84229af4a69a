"""Remeshing: triangles that a solver accepts, every vertex on the surface.

`halfedges`  a mesh that can be edited in place: collapse, swap, split
`shape`      how good a triangle is
`passes`     passes over the mesh that make its triangles better
`ground`     what vertices that have moved are put back onto: a field, or the mesh as it was
`blocks`     the mesh cut into blocks that are worked on side by side
`piece`      the work on one block
`remesh`     all of it, in sweeps with their borders in different places

Nothing here knows where a surface comes from.
"""
