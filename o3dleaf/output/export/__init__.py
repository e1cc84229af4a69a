"""Meshes, particles and distances for the next program, and labels read back from files.

Nothing here changes a mesh: what a program cannot take is refused.

`labelled_mesh`   what every writer is given: vertices in the file's unit, triangles, labels, normals, scalars
`read`            a mesh with its labels: PLY, STL and OBJ
`text`            STL with named solids, OBJ with groups
`binary`          STL and PLY, record by record
`glb`             glTF 2.0 for the web
`vtk`             VTP: surfaces and particles for ParaView
`selection`       one part of a mesh, another origin
`leaf_scalars`    values of a leaf's field at the vertices
`consumers`       which program wants which format and unit; `export_mesh`
`particles`       a surface covered and a solid filled with particles
`distance_grid`   the signed distance to a closed mesh on a grid
`particle_loops`  samples thinned, columns through a mesh
"""
