"""Layers that lie close together: averaged into one sheet, or told apart.

`widths`     how wide a cloud must be averaged to be one sheet
`parting`    layers told apart where they lie closer than points
`two_sides`  both sides of a thin leaf, moved to the middle between them
"""
