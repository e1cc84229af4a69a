"""A leaf of any shape laid out in the plane: one open sheet through its scan, and what is made of it.

`sheets`  a cloud averaged, triangulated and glued into sheets without handles
`sheet`   `find_sheet`: from any scan to one open sheet
"""
