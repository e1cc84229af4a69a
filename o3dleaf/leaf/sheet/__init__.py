"""From any scan of a leaf to one open sheet: averaged where it must be, triangulated, and glued without handles.

`average`        points averaged across their surface, and thinned
`scan_lines`     scan lines far apart, thinned along themselves
`stars`          triangles between points: the Delaunay stars of tangent planes
`gluing`         triangles glued into sheets without handles
`holes`          small holes closed, flaps of other sheets cut off
`open_sheets`    a cloud, averaged over given widths, as open sheets
`widths`         how wide a cloud must be averaged to be one sheet
`two_sides`      both sides of a thin leaf, moved to the middle between them
`parting`        layers told apart where they lie closer than points
`pieces`         what a sheet leaves out, and where it is cut: layers, leaves that touch, slits
`sheet`          `find_sheet`: all of it together
`scan_pieces`    the pieces of a scan, as `piece` counts them
`average_loops`  the compiled loops of averaging and thinning
`star_loops`     the compiled loops of stars
`gluing_loops`   the compiled loops of gluing
`hole_loops`     the compiled loop that triangulates a hole
"""
