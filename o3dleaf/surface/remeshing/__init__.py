"""Remeshing: triangles that a solver accepts, every vertex on the surface.

`halfedge_loops`     a mesh that can be edited in place: collapse, swap, split
`shape_loops`        how good a triangle is
`pass_loops`         passes over the mesh that make its triangles better
`projection_target`  what vertices that have moved are put back onto
`blocks`             the mesh cut into blocks that are worked on side by side
`submesh`            the work on one block
`remesh`             all of it, in sweeps with their borders in different places
"""
