"""A drop at rest on a leaf, by Surface Evolver.

`ground`    the surface under a drop: heights over a plane, as a cosine series
`cap`       the shape that it starts from
`datafile`  the file for Evolver
`shape`     the shape that it found
`evolver`   Evolver at work
`site`      heights of a leaf around a place without hairs
"""
