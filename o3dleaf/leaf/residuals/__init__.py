"""Residuals: a scan's points against a blade, by noise and by place.

`noise`       the noise of a scan about a blade, by which a fit is judged
`places`      where a blade does not hold its scan
`off_blade`   feet of points on a blade, those outside its margin, and their spacing
`two_layers`  points on both sides of a blade that runs midway between them
`bent_margin` strips along the margin that bend off the blade
`known_area`  how well the area of a blade is known from a random scan of it
`lost_relief` the area that a blade lacks as it smooths relief away
`rounding`    coordinates rounded so coarsely that a scan has terraces
"""
