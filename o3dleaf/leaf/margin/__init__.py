"""The margin: where the leaf ends, in the chart.

`margin`            the margin: the closed curve in the chart where the leaf ends
`margin_rings`      the curves where the leaf ends, of a covered region
`margin_curve`      rings smoothed without shrinking, and grown to where the leaf ends
`tips`              sharp tips restored
`edge`              the curve of greatest likelihood of a random sample
`gaps`              gaps among a sample's triangles: chance's and the leaf's
`sample_region`     what a planar sample covers
`missing_area`      what the sample leaves out at the border of that
`traced_border`     whether the border of that was set on the margin, as a mesh's vertices are
`sample_lines`      the lines of a sample, as laser line scanners leave them
`scan_planes`       the planes of a line scanner that those lie in
`sample_triangles`  its Delaunay triangles
`sample_spacing`    how it is spaced, place by place
`taper`             thickness that falls towards the margin
`taper_loops`       the distance to the margin by a grid of cells, and the profile of the edge
`chords`            a closed curve as chords
`sheet_band`        the band between a lattice and the margin as triangles
`sheet_mesh`        the plane inside a margin as triangles, cut along it
"""
