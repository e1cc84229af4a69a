"""From any scan of a leaf to one open sheet: averaged where it must be, triangulated, and glued without handles.

`average`          points averaged across their surface, and thinned
`scan_lines`       scan lines far apart, thinned along themselves
`stars`            triangles between points: the Delaunay stars of tangent planes
`gluing`           triangles glued into sheets without handles
`holes`            small holes closed, flaps of other sheets cut off
`open_sheets`      a cloud, averaged over given widths, as open sheets
`layers`           layers that lie close together: averaged into one sheet, or told apart
`pieces`           what a sheet leaves out, and where it is cut: layers, leaves that touch, slits
`averaged_sheets`  the sheets of a scan, averaged as wide as noise and layers need
`sheet`            `find_sheet`: all of it together
`scan_pieces`      the pieces of a scan, as `piece` counts them
`average_loops`    the compiled loops of averaging and thinning
`star_loops`       the compiled loops of stars
`gluing_loops`     the compiled loops of gluing
`layer_loops`      the compiled loop of what lies above and below
`hole_loops`       the compiled loop that triangulates a hole
"""
