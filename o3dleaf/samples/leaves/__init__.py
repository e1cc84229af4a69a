"""Leaves of any shape, each an outline in the plane and a known surface over it.

`outlines`        outlines in the plane
`plane_mesh`      triangles of a polygon with holes, and integrals over it
`sweep`           the surface: a circular arc carried along a curve
`margin`          closest points of a lifted margin
`leaf_shape`      outline and surface together, as a Field
`leaf_scan`       its scans
`kinds`           curled, twisted, wavy, eaten, lobed, cupped, on a petiole, in two layers
`leaf_pair_scan`  scans of two leaves
`resting`         two leaves, one of which rests on the other
`crossing`        two leaves that cross
`lobes`           leaves with deep lobes
`seedling`        two blades on a sheath
`cut_base`        flat leaves that were cut off, with their midribs
`on_table`        a leaf and a table, and pressed leaves
`scan_files`      their scans as files
"""
