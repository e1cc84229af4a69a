"""Splines of voxels: balls that sit alike on a lattice share their points, their matrix and its factor.

`lattice_balls`  the balls of a volume, and its smoothing where that is to be chosen
`lattice_fit`    the fit of all balls, class by class, and what it takes
`class_solver`   one factorization for all balls of a class, here or on a worker
"""
