"""Balls split at sharp creases: a spline for each smooth sheet, combined by minima and maxima.

`sheets`         the smooth sheets of a ball's points
`creases`        creased splines, and where they are worth it
`quadric_loops`  quadrics over the mean plane of points
`sheet_loops`    points into sheets
`split_loops`    balls split, constraints with them
`crease_loops`   whether a split is worth it
"""
