"""Micro-CT volume in, (points, values) out: formats, threshold, alignment, samples.

`volume`     `Volume`: voxels with spacing, origin and unit
`tiff`       TIFF files and folders of slices
`lattice_headers`  headers of MetaImage, NRRD and NIfTI, looked over
`formats`    NPY, NRRD, MHA and NIfTI; `read_volume`
`threshold`  the intensity between air and leaf
`align`      the rigid motion that lays a blade flat
`box`        the largest upright box in a turned one
"""
