"""Meshes, particles and distances for the next program.

Nothing here changes a mesh: what a program cannot take is refused. The formats stand in `o3dleaf.io`.

`selection`       one part of a mesh, another origin
`leaf_scalars`    values of a leaf's field at the vertices
`consumers`       programs, their formats and units; `export_mesh`
`thinning`        samples of a surface, from which particles are chosen
`particles`       a surface covered and a solid filled with particles
`boundary`        a solid's boundary in layers of particles, on the field itself
`facets`          triangles with inclination, curvature and side, for retention models
`distance_grid`   the signed distance to a closed mesh on a grid
`particle_loops`  samples thinned, columns through a mesh
"""
