"""Local fits: what is fitted in each ball of a cover, by one protocol, ``fit(cover, data) -> LocalFits``.

`fitter`               the protocol: scattered data, fitters, local fits
`splines`              splines of values
`potentials`           splines of points and normals: Hermite, curl-free
`polynomials`          moving least squares of points and normals
`fields`               any field a ball
`stretches`            distances by the covariance of normals
`columns`              splines of several columns of values
`voxels`               splines of voxels: balls that share a factorization
`smoothing_selection`  the smoothing of each ball
`fitter_selection`     the fit of points and normals that suits the noise, and what fits say of points left out
`cross_validation`     errors at groups of points left out
`blending`             the compiled blend, driven over blocks
`fit_loops`            fits of values, their spectra and held-out errors
`oriented_loops`       fits of points and normals
`blend_loops`          Shepard's sum over the balls that contain a point
`weight_loops`         Wendland's weight
`jet_loops`            products and quotients of jets
"""
