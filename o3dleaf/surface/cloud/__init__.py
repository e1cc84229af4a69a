"""A point cloud made ready: faulty points go, and every point has an outward normal.

`neighbors`       nearest neighbors, planes through them, and spacings by their distances
`cells`           points sorted into cubic cells
`noise`           noise and spacing at some places, on their own side
`surfels`         points or groups of them with their planes
`branchings`      lines along which three or more sheets meet
`oriented_cloud`  the one class for a cloud, with its tree, neighbors, spacing and noise
`downsample`      points averaged in voxels, sheet by sheet
`rounding`        steps that coordinates were rounded to, and points on levels averaged
`outliers`        points that belong to no surface
`usable_points`   finite, distinct points that are no outliers
`normals`         agreement of neighbors' normals, and the pieces that agree
`winding`         the winding number of the whole: signs of pieces, and normals in doubt
`orientation`     normals that point outward: estimated, given, or turned to the scanner
`constraints`     points off the surface with their signed distances
`preprocess`      all of it: any cloud to points and outward normals
`cloud_loops`     the compiled loops over points
`parity_loops`    the compiled loops of joining pieces, and of the winding number
"""
