"""Maps of a sheet to the plane: what they ask of it, how they are found, how they stretch it.

`handles`      where a sheet has handles
`sheet_shape`  what a chart asks of a mesh
`geodesics`    distances along a sheet
`stretch`      how a chart stretches its sheet
`elimination`  sparse matrices of a mesh, in an order to eliminate
`rigid_energy` the energy of a chart that is as rigid as possible
`newton_descent` a chart at rest
`embedding`    maps of a sheet to the plane
`untangle`     single flipped triangles put right, and charts that wind twice around a place
`overlap`      overlaps of a chart with itself
`one_layer`    charts that lie over themselves nowhere
"""
