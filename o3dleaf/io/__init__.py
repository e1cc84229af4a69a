"""Point clouds, meshes, grids and models from and to files: one writer a format, whole or not at all.

`clouds`         point clouds by format: PCD, text, LAS, E57
`polygons`       faces of any number of corners, and formats that have them, read without trust
`point_cloud`    point clouds, by the suffix of the name
`labelled_mesh`  a triangle mesh with a label for each triangle
`triangle_mesh`  `read_mesh` and `write_mesh`, by the suffix of the name
`geometry`       the mesh of a file, or its point cloud
`mesh_data`      arrays of a mesh for the writers, block by block
`mesh_stream`    a surface made block by block, in memory or in a file
`ply`            binary PLY of meshes and points, written at known places
`ply_reader`     PLY files: headers, points, faces, labels
`stl`            binary STL, and corners joined to vertices
`stl_text`       STL as text, with named solids
`obj`            OBJ, with groups
`glb`            glTF 2.0 for the web
`vtk`            VTP: surfaces and particles for ParaView
`grid`           regular grids of numbers: VTI, NRRD and NPY
`models`         saved models: one file, no pickle
"""
