"""Kernels with a length of their own, 1/ε: the Gaussian and the multiquadrics, for one interpolant of all the data.

`shaped_kernels`  the kernels: φ, its sign, least degree, ε
`shaped_loops`    their matrices, and sums of them with all derivatives
`dense_system`    the system of any kernel, with its tail or without: solutions and spectra
"""
