"""The blade as a surface of its own: x = S(u, v) + w n(u, v), u along the midrib and v across it.

`spline_loops`      sums of r³ in one ball
`surface_loops`     the surface of all balls
`lift_loops`        its normal, curvatures and the lift along it
`feet_loops`        closest points
`splines`           splines of three components in one ball
`feet`              samples of the surface, from which closest points are found
`surface`           the surface S of the chart
`local_smoothing`   smoothing chosen place by place
`fitted`            what is fitted, and what a fit hands on: the surface, its sheet and chart, the feet
`thickness`         the factor of thickness, from a map
`tight_bends`       bends tighter than a scan can show
`surface_fit`       S fitted to the points of a scan, at parameters that are their feet, in a chart relaxed on it
`contacts`          ends of the blade that would pass through another part of it
`mirror`            stretches of the margin that are hidden, and the other half's mirror image
`parametric_blade`  the blade on it
`build`             the points of a leaf to its blade
"""
