"""The micro-structure of the whole plane: patches repeated, cropped, blended, or cut into tiles that never repeat.

`layer`       a field over the plane with air above and below
`tile_crop`   the crop of a patch that options ask for
`tiling`      one patch repeated over the plane, without copying it (paper, section 2.6)
`seams`       mismatch of the faces of neighboring tiles, one number
`crop`        the offset and the period whose faces match best
`crossfade`   copies that fade into one another where both have data
`copy_loops`  the copies that a point sees, mirrored and shifted, and their windows
`patches`     several patches along the leaf, or one for each of its sides
`wang`        Wang tiles, laid over the plane without repetition
`period`      the period of a texture, and which part of it lies where
`table_map`   a smooth function over the plane, from a table
`hairs`       hairs, thinned out as a map wants it
"""
