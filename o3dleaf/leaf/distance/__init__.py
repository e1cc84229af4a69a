"""Distance to the leaf, projection onto it, its normals and curvature.

`projection`        projection onto the surface, normals, mean curvature
`solid`             what is leaf: the field in the outline, or the closed solid
`tile_samples`      one tile's surface as samples
`rim_strips`        the rim as strips
`boxes`             a tree of boxes over the blade
`around`            where the leaf cannot be
`distance`          signed distance and closest points
`grid`              the leaf on a regular grid in a file
`projection_loops`  Jacobian of the lift, steps of Newton's method
`search_loops`      the nearest sample and the nearest strip
"""
