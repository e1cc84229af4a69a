"""A mesh in numbers and places.

`topology`          edges, pieces, fans and boundary loops
`components`        edge-connected pieces
`clip`              triangles outside an outline discarded
`crossings`         self-intersections, exactly
`measurements`      all measurements, in one pass
`defects`           the triangles of every defect
`deviation`         distances to a field and a scan
`surface_distance`  the distance between two meshes
`mesh_report`       a mesh in numbers
`inspection`        report, defects and deviations together
`adjacency_loops`   edges and pieces
`measure_loops`     angles, areas and lengths
`predicate_loops`   exact signs of determinants
`contact_loops`     contact of two triangles
`bvh_loops`         triangles whose boxes overlap
"""
