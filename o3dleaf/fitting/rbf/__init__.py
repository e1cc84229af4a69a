"""One local interpolant: kernel, polynomial tail, smoothing, solve.

The chapter answers one question: given a few hundred scattered values, which function of least
bending energy takes them (or nearly takes them, when smoothed)? Everything above it only uses that
the answer can be evaluated and differentiated.

`kernels`             polyharmonic kernels: φ, φ′/r, order, θ
`shaped`              kernels with a length of their own: Gaussian, multiquadrics
`tail`                monomials of the tail
`smoothing`           ρ, the diagonal and their choice by GCV; which splines are fitted
`factor`              a local system factored once for many columns of values
`interpolant`         `RBFInterpolant`
`radial_loops`        φ and its derivatives over r
`evaluation_loops`    values, gradients and Hessians of kernels and tails
`reflector_loops`     Householder reflectors: onto the null space of Pᵀ
`cholesky_loops`      Cholesky factors and triangular systems
`solve_loops`         the solution of one local system
`column_loops`        the same for many columns of values
`spectrum_loops`      one eigen-decomposition for every smoothing
`shared_noise_loops`  what points of a group share of their error
`shared_error_loops`  smoothing chosen by groups left out, and the fit with it
`potential_loops`     potentials of points and normals: Hermite and curl-free
"""
