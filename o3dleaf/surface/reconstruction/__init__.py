"""A surface from any point cloud: a field fitted, its surface followed, cut off where the data end.

`fit`                   an oriented cloud to a field
`proximity`             distances to the nearest data, in their own spacings
`branch_cut`           a surface cut where sheets of its data branch
`extract`               the surface of a field near the data
`along_mesh`            distances along a mesh
`solid_angle`           the winding number: the solid angle that data fill of the view
`overshoots`            where a surface runs on past data that close around it
`closing`               a surface followed, its field corrected at overshoots; closed or open, and why
`trim`                  the surface cut off where it goes on past its data
`unresolved`            handles, breaks and losses where data are too few for them
`vertex_support`        sampling density and residual at each vertex
`attributes`            the cloud's colors and scalars at the vertices
`finish`                normals, colors and support put on the mesh
`reconstruct`           the whole job, one step a line
`vertex_support_loops`  the compiled loops of proximity and support
"""
