"""Normals that point outward: estimated, given, or turned to the scanner.

`sides`            outward normals of surfels, by neighbors and by what encloses a volume
`close_sheets`     two sheets that groups of points do not tell apart
`orientation`      normals estimated and turned outward
`contradictions`   lines along which normals contradict one another
`given_normals`    normals that came with a cloud
`viewpoint`        normals turned to the scanner
`viewpoint_loops`  the compiled loops of that
"""
