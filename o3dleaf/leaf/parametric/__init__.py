"""The blade as a surface of its own: x = S(u, v) + w n(u, v), u along the midrib and v across it.

`surface_fit`  S fitted to the points of a scan, at parameters that are their feet
`build`        the points of a leaf to its blade
"""
