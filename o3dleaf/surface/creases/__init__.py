"""Sharp creases as a local fitter: balls split into smooth sheets, a spline for each, combined by minima and maxima.

`creased_splines`    `CreasedSplines`, and where splits are worth it
`sheets`             the smooth sheets of a ball's points
`quadric_loops`      quadrics over the mean plane of points
`sheet_loops`        points into sheets
`split_loops`        balls split, constraints with them
`crease_loops`       whether a split is worth it
`composition_loops`  minima and maxima of splines in the blend
"""
