"""Meshes cleaned and simplified; nothing gets worse.

`editable_mesh`   a mesh under repair, which remembers where its parts came from
`repairs`         repairs that move no vertex
`merge_vertices`  close vertices joined
`flips`           edges flipped where triangles are flat or folded
`holes`           holes closed
`meshlab`         MeshLab's filters (the only file that imports pymeshlab)
`clean`           `clean_mesh`: repairs in rounds until a mesh is at rest
"""
