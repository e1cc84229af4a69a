"""Point clouds, meshes and models from and to files.

`point_cloud`    point clouds, through Open3D
`labelled_mesh`  a triangle mesh with a label for each triangle
`triangle_mesh`  triangle meshes, whole and with every digit
`geometry`       the mesh of a file, or its point cloud
`model_file`     saved models: one file, no pickle
"""
