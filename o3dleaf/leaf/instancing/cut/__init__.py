"""A tile cut along a smooth margin: its triangles clipped, and the wall between the clipped edges.

`cut_tile`    the placement of a tile that the margin cuts, two sheets or one solid
`clip_loops`  triangles clipped where the distance to the margin is zero
`wall_loops`  the wall over the margin, column by column
`ear_loops`   polygons of the wall triangulated
`flip_loops`  the best diagonals of these
"""
