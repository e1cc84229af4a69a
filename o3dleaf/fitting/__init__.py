"""Scattered data to a function: radial basis functions, and their partition of unity.

`rbf`      one local interpolant
`pu`       many balls: cover, local fits, blend
`creases`  balls split at sharp creases
"""
