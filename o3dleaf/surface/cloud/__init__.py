"""A point cloud made ready: what is wrong with it goes, and every point has an outward normal.

`neighbors`       nearest neighbors and planes through them
`cells`           points sorted into cubic cells
`prepare`         a scan without repeated and stray points
`stray`           points that belong to no surface
`point_spacing`   spacing of the points on their surface
`noise`           standard deviation of the noise
`surfels`         points or groups of them with their planes
`normals`         normals compared with their neighbors'
`pieces`          neighbors joined into pieces of one side
`enclosure`       which side encloses a volume
`orientation`     normals estimated and turned outward
`given`           normals that came with a cloud
`downsample`      points averaged in voxels, sheet by sheet
`oriented_cloud`  all of it: any cloud to points and outward normals
`constraints`     points off the surface with their signed distances
`cloud_loops`     the compiled loops over points
`parity_loops`    signs of pieces and the winding number
"""
