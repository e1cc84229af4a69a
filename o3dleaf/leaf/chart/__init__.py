"""The blade as a parametrised surface over a chart of low distortion.

`margin`          the margin: the closed curve in the chart where the leaf ends
`margin_curve`    rings smoothed without shrinking, and grown to where the leaf ends
`margin_tips`     sharp tips restored
`sample_region`   what a planar sample covers
`sample_spacing`  how it is spaced, place by place
`chords`          a closed curve as chords
`sheet_band`      the band between a lattice and the margin
`sheet_mesh`      the plane inside a margin as triangles, cut along it
"""
