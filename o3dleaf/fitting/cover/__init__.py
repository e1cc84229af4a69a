"""Balls over a box: an adaptive cover of scattered points, a cover of a lattice, and which balls contain a point.

`cover`           balls that cover a box and contain a few hundred points each
`contrast`        points from around for balls beside a cluster
`voxel_lattice`   the lattice of voxels in space, and the box that they fill
`lattice_band`    the tiles of a lattice near a level, and larger ones elsewhere
`lattice_cover`   balls around the tiles of a lattice, in classes that sit alike on it
`lattice_sample`  some of those balls, without the rest
`bare_plane`      the plane in one of those
`voxel_values`    the values of a lattice's voxels, ball by ball
`voxel_noise`     the noise of voxels, where it is correlated
`tree`            the tree of boxes that the balls are found by
`index`           the balls that contain a point
`ball_loops`      the tree, points folded into the box, points sorted into balls
"""
