"""`o3dleaf leaf`.

`mesh`  options of the mesh, and its writing
`job`   the whole road
"""
