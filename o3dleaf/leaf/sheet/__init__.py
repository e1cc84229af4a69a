"""From any scan of a leaf to one open sheet: a mesh with a rim and no handle, through its points.

`average_loops`  the compiled loops of averaging and thinning
`average`        points averaged across their surface, and thinned
`star_loops`     the compiled loops of Delaunay stars
`stars`          triangles between points of a sheet
`gluing_loops`   the compiled loops that glue triangles
`gluing`         triangles glued into sheets without handles
`open_sheet`     a cloud, averaged over given widths, as open sheets
`widths`         how wide a cloud must be averaged to be one sheet
`hole_loops`     the compiled loop that triangulates a hole
`holes`          small holes closed, flaps cut off
`leftovers`      pieces, layers and branchings that a sheet leaves out
`sheet`          `find_sheet`: from any scan to one open sheet
"""
