"""Splines of several columns of values: one factorization a ball, and one distance a pair, for all of them.

`column_splines`      their fit and their blend
`column_fit_loops`    the compiled fits, and their spectra
`held_out_loops`      errors at points left out
`column_blend_loops`  Shepard's sum of all columns
"""
