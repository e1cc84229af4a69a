"""Many balls as one function: Shepard's blend of local fits.

The chapter turns local interpolants into a function of any number of points at a cost that grows with their number:
each ball is small, and a query meets only the few that contain it.

`interpolant`    `PUInterpolant`
`blend`          values, gradients and Hessians of a blend
`single_blend`   the same in single precision
`lattice_blend`  rough values on a lattice of the voxels' step
`diagnostics`    degrees of freedom, score and condition of each ball
"""
