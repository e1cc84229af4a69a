"""Distance to the leaf, projection onto it, its normals and curvature.

`projection`        projection onto the surface, normals, mean curvature
`solid`             the field in the outline, or the closed solid
`roots`             roots of a field on the way between two points
`tile_samples`      one tile's surface as samples
`rim_strips`        the rim as strips
`boxes`             a tree of boxes over the blade
`cell_parts`        parts of cells beside a tapered rim
`cells`             the cells of the blade, and their tree
`around`            bounding balls of the leaf
`distance`          signed distance and closest points
`grid`              a regular grid in a file
`measured_leaf`     a leaf that can be measured
`projection_loops`  mean curvatures, steps towards the closest point
`search_loops`      the nearest sample of the surface
`strip_loops`       the nearest strip of the rim
"""
