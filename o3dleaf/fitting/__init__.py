"""Scattered data to a function: radial basis functions, and their partition of unity.

`rbf`    one local interpolant
`cover`  balls over a box, and which of them contain a point
`local`  what is fitted in the balls, and its blend
`pu`     many balls as one function
"""
