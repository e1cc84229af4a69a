"""Meshes, particles and distances for the next program, and labels read back from files.

`surface`    what every writer is given: vertices in the file's unit, triangles, labels, normals, scalars
`consumers`  which program wants which format and unit; `export_mesh`
`text`       STL with named solids, OBJ with groups
`binary`     STL and PLY, record by record
`glb`        glTF 2.0 for the web
`vtk`        VTP: surfaces and particles for ParaView
`read`       a mesh with its labels: PLY, STL and OBJ
`particles`  a surface covered and a solid filled with particles
`distance`   the signed distance to a closed mesh on a grid
`job`        one export from file to file, as the command line asks for it

`loops` holds the compiled code. Nothing here changes a mesh: what a program cannot take is refused.
"""
