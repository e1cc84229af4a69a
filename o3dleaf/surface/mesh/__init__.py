"""What a mesh is, in numbers and places.

`topology`          edges, pieces, fans and boundary loops
`components`        edge-connected pieces
`clip`              triangles outside an outline discarded
`crossings`         self-intersections, exactly
`measurements`      all that is found in one pass
`defects`           the triangles of every defect
`deviation`         distances to a field and a scan
`surface_distance`  how far two meshes are apart
`mesh_report`       a mesh in numbers
`inspection`        report, defects and deviations together
`adjacency_loops`   edges and pieces
`measure_loops`     angles, areas and lengths
`predicate_loops`   exact signs of determinants
`contact_loops`     whether two triangles meet
`bvh_loops`         which triangles' boxes overlap
"""
