"""A volume as it would be without what the scanner, and the sample's holder, did to it.

`pure`   voxels that are air or leaf, and nothing between
`drift`  air and leaf of the same intensity in every slice
`rings`  rings around the scanner's axis, found and removed
`bend`   a blade that bends in its volume, straightened
"""
