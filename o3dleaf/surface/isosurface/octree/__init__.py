"""A surface followed on the leaves of an octree, which are as wide as the data around ask for.

`octree`         cells that are split where points ask for shorter steps, and leaves
`traced`         the edges that a surface crosses, joined to loops around each leaf
`octree_band`    leaves that grow across the faces a surface crosses
`loop_vertices`  a vertex for each loop, on the surface or where tangent planes meet
`dual_surface`   a polygon for each edge: the dual of the octree
`octree_loops`   cells in a hash table, leaves and the nodes on their boundaries
`tracing_loops`  loops traced around leaves
"""
