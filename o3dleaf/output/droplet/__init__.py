"""A droplet on the leaf, for OpenFOAM: the case, its run, and what comes of it.

`template/` has the case's dictionaries as plain files, with all numbers in one of them.

`units`     the impact in SI, and in the units that the solver runs in
`frame`     x along the leaf, y across, z its normal
`surfaces`  the leaf around the landing place, its smooth twin, the leaf without hairs
`landing`   places on a ridge, in a furrow, on a hair
`box`       the box of cells around the droplet
`written`   a case that was written
`case`      the folder of a case
`solver`    OpenFOAM at work on it
`readings`  what it has written, as one table
`pictures`  leaf and twin side by side, and the animation
`page`      figures and curves as HTML
`results`   all of this for a folder
"""
