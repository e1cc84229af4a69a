"""Micro-CT volume in, (points, values) out: formats, threshold, alignment, samples.

`volume`     `Volume`: voxels with spacing, origin and unit
`on_disk`    `VolumeOnDisk`: read where it is asked for
`formats`    files in, `Volume` out; TIFF out
`voxel_file` voxels as another process reads them
`mixture`    air, leaf and the voxels between them, fitted to a histogram
`threshold`  the intensity between air and leaf
`voids`      voids and loose pieces of a volume over a range of levels
`corrections` drift, rings, and a blade that bends
`blade`      the sheet among what is solid in a volume
`heights`    planes and quadrics through the heights of a blade
`align`      the rigid motion that lays a blade flat
`hairs`      hairs that the sides cut, and a crop without
`box`        the largest upright box in a turned one
`patch`      the part that tiles are made of: blade from side to side, and nothing else
"""
