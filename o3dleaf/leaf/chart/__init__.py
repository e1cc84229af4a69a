"""The blade as a surface of its own: a chart of its scan, a surface over the chart, and heights along its normal.

`surface_loops`     the surface, its normal and the lift along it
`feet_loops`        closest points
`splines`           splines of three components in one ball
`feet`              samples of the surface, from which closest points are found
`surface`           the surface S of the chart
`taper`             thickness that falls towards the margin
`sheet_mesh`        the plane inside the margin as triangles
`parametric_blade`  the blade on it
"""
