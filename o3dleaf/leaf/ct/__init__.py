"""Micro-CT volume in, (points, values) out: formats, threshold, alignment, samples.

`volume`     `Volume`: voxels with spacing, origin and unit
`on_disk`    `VolumeOnDisk`: read where it is asked for
`formats`    files in, `Volume` out; TIFF out
`voxel_file` voxels as another process reads them
`mixture`    air, leaf and the voxels between them, fitted to a histogram
`threshold`  the intensity between air and leaf
`voids`      voids and loose pieces of a volume over a range of levels
`pure`       voxels that are air or leaf, and nothing between
`drift`      air and leaf of the same intensity in every slice
`rings`      rings around the scanner's axis, found and removed
`blade`      the sheet among what is solid in a volume
`align`      the rigid motion that lays a blade flat
`hairs`      hairs that the sides cut, and a crop without
`box`        the largest upright box in a turned one
`patch`      the part that tiles are made of: blade from side to side, and nothing else
"""
