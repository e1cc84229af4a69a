"""The micro-structure of the whole plane: patches repeated, cropped where their faces match, and blended.

`layer`       a field over the plane with air above and below
`tiling`      one patch repeated over the plane, without copying it (paper, section 2.6)
`seams`       how badly the faces of neighboring tiles match, one number
`crop`        the offset and the period whose faces match best
`crossfade`   copies that fade into one another where both have data
`copy_loops`  which copies a point sees, mirrored and shifted, and their windows
`patches`     several patches along the leaf, or one for each of its sides
"""
