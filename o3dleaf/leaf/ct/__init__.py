"""Micro-CT volume in, (points, values) out: formats, threshold, alignment, samples.

`volume`     `Volume`: voxels with spacing, origin and unit
`tiff`       TIFF files and folders of slices
`formats`    NPY, NRRD, MHA and NIfTI; `read_volume`
`counts`     about how many voxels a file has
`threshold`  the intensity between air and leaf
`align`      the rigid motion that lays a blade flat
`box`        the largest upright box in a turned one
"""
