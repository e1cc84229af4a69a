"""Validation of input, all of the package: each check returns a clean array, or raises `InputError`.

`scalars`      single numbers, and words of which there are some
`arrays`       arrays of numbers: of one type and layout, finite, of a size to calculate with
`coordinates`  points, boxes and directions: rows of coordinates
`attributes`   attributes of points and triangles: values, weights, labels, normals
`voxels`       arrays of voxels, and their steps
`files`        files that can be read
"""
