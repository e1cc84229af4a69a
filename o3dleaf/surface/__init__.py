"""Any cloud, any field, any mesh: nothing here depends on leaves.

`cloud`           a point cloud made ready
`mesh`            topology, defects and measures of a mesh
`creases`         a local fitter that keeps sharp creases
`isosurface`      a field to triangles
`repair`          meshes cleaned and simplified
`remeshing`       triangles that a solver accepts
`reconstruction`  a surface of any point cloud
"""
