"""The leaf: a blade of the scan, the micro-structure of the CT, and their fusion into one implicit surface.

A point of the world becomes (along, across, up); the blade is a height over (along, across); the
micro-structure repeats over that plane. Composed, they are one implicit function of the whole leaf.

`ct`          micro-CT volumes
`macro`       the blade: midrib, frame, height map, outline
`texture`     the micro-structure, repeated over the plane
`instancing`  one tile polygonised, set down everywhere
`distance`    distance to the leaf, and projection onto it
`multiscale`  `MultiscaleLeaf`, the implicit function
`meshing`     its surface as a mesh
`remeshing`   its surface remeshed
`options`     what can be chosen where a leaf is built
`pipeline`    scan and volume to a leaf
`models`      saved models read again
"""
