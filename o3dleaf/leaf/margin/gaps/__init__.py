"""Gaps among the triangles of a planar sample: which are chance's, and which are the leaf's.

`passed_by`      those that a line scanner's planes pass by
`sample_gaps`    gaps by what they are enclosed in, by their area, and by their width
`narrow_bays`    gaps of triangles that are each no larger than chance's
`joined_pieces`  pieces over gaps, and points apart
`hole`           a hole of the leaf, kept or filled
"""
