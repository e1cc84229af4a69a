"""Scattered data to a function: radial basis functions, and their partition of unity.

`rbf`    one local interpolant
`cover`  balls over a box, and which of them contain a point
`local`  local fits in the balls, and their blend
`pu`     many balls as one function
"""
