"""The margin of a random sample as an edge that is seen through its points.

`edge_score`         what single points say of an edge near them
`third_differences`  third differences around a closed curve, and the systems that they make
`edge_frame`         a closed curve with the points near it
`discoveries`        stretches of a curve where a softer one is more likely than by chance
`edge_fit`           the curve of greatest likelihood, as stiff as the sample allows
`edge_noise`         how far noise carries points across an edge
`edge_excess`        how many points more there are along it, of a thinned sample
`least_distance`     the distance that a sample was thinned to, and what that makes of its edge
`tip_ends`           where the width of a tip falls to nothing
`tip_likelihood`     the likelihood of the points of a tip, by its half width and its middle line
`lines_variance`     how well the area inside is known where points lie on lines
"""
