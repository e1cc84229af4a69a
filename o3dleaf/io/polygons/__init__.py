"""Faces of any number of corners in files, read without trust and cut into triangles.

`triangulation`  faces of any number of corners as triangles
`numbers`        words of a text as numbers
`ply_items`      the items of a PLY file's elements, binary or text
`off`            OFF, with normals and colors
"""
