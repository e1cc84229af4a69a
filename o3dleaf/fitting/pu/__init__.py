"""Many balls: an adaptive cover, a local fit in each ball, and Shepard's blend of them all.

The chapter turns the previous one's local interpolant into a function of any number of points at a
cost that grows with their number: each ball is small, and a query meets only the few that contain it.

`cover`                balls that cover a box and hold a few hundred points each
`tree`                 the tree of boxes that the balls are found by
`index`                which balls contain a point
`local`                splines of values in balls, and any fields
`oriented`             fits to points and normals: Hermite, curl-free, moving least squares
`smoothing_selection`  how much each ball is smoothed
`fitter_selection`     which oriented fit suits the noise
`cross_validation`     errors at groups of points left out
`blend`                values, gradients and Hessians of the blend
`lattice_fit`          voxels: balls that share a factorization
`interpolant`          `PUInterpolant`
`diagnostics`          degrees of freedom, score and condition of each ball
`weight_loops`         Wendland's weight
`jet_loops`            products and quotients of jets
`ball_loops`           the tree, local fits and the blend
`oriented_loops`       balls of oriented points
"""
