"""Remeshing: triangles that a solver accepts, every vertex on the surface.

`halfedge_loops`     a mesh that can be edited in place: collapse, swap, split
`shape_loops`        the quality of a triangle
`score_loops`        scores of triangles in a mesh, and conditions on edits
`edit_loops`         edits where they make triangles better, and passes of them
`move_loops`         vertices moved where that makes triangles better
`limits`             limits of the edits
`projection_target`  surfaces that vertices are projected onto when they have moved
`blocks`             the mesh cut into blocks that are edited side by side
`submesh`            the edits of one block
`apart`              all but what came to cross, which stays as it was
`remesh`             all of it, in sweeps with their borders in different places
"""
