"""Sharp tips of a margin, which a sample ends before and smoothing rounds.

`margin_tips`  sharp tips restored
`tip_loops`    where a tip begins on a curve, and the triangle that it would be
"""
