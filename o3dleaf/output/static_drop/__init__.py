"""A drop at rest on a leaf, by Surface Evolver.

`ground`    the surface under a drop: heights over a plane, as a cosine series
`cap`       the shape that it starts from
`datafile`  what Evolver reads
`shape`     what it has found
`evolver`   Evolver at work
`site`      heights of a leaf around a place without hairs
"""
