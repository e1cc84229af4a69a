"""Meshes cleaned and simplified without new defects.

`editable_mesh`   a mesh under repair, with the origin of its parts
`repairs`         repairs that move no vertex
`merge_vertices`  close vertices joined
`flips`           edges flipped where triangles are flat or folded
`holes`           holes closed
`meshlab`         MeshLab's filters (the only file that imports pymeshlab)
`collapse`        edges collapsed until triangles would cross others
`simplify`        `simplify_mesh`: edges collapsed
`clean`           `clean_mesh`: repairs in rounds until nothing changes
"""
