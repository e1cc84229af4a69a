"""The leaf: a blade of the scan, the micro-structure of the CT, and their fusion into one implicit surface.

A point of the world becomes (along, across, height above the blade); the blade is a surface of its own over a chart
that keeps lengths or, as in the paper, a height over a plane; the micro-structure repeats over (along, across).
Composed, they are one implicit function of the whole leaf.

`ct`              micro-CT volumes
`blade`           the base of all blades
`macro`           the paper's blade: midrib, frame, height map, outline
`sheet`           from any scan to one open sheet
`chart`           a sheet laid flat, its midrib along u
`margin`          where the leaf ends, in the chart
`parametric`      the blade as a surface of its own
`texture`         the micro-structure, repeated over the plane
`instancing`      one tile polygonized, set down everywhere
`textured_blade`  the implicit function: a texture on a blade
`distance`        distance to the leaf, and projection onto it
`tile_lattice`    the lattices that divide its period
`remeshing`       its surface as a projection target; its mesh remeshed
`thin_rim`        vertices lowered beside a tapered rim, where triangles would cross
`meshing`         `MeshPlan`: its surface as a mesh
`fine_windows`    a mesh with finer windows
`residuals`       a scan's points against a blade: their noise, their places
`fit_quality`     `FitQuality`: what a blade holds of its scan and what it does not
`folds`           folds where a blade bends too tightly for the micro-structure
`multiscale`      `MultiscaleLeaf`: all of it together
`options`         options of building a leaf
`mesh_step`       the step of a mesh where none was asked for
`mesh_needs`     memory and time of its mesh, before it is fitted
`paper_pipeline`  a scan to the paper's blade
`pipeline`        scan and volume to a leaf
`saved`           models that were saved, read again
"""
