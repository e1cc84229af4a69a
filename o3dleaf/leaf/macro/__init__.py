"""The blade: the macro-scale leaf of the scan.

`midrib`          the midrib, found
`midrib_normals`  normals along it
`frame`           (along, across, up) about the midrib
`frame_quality`   how well a frame serves its leaf
`height`          the height map H
`robust`          a height through scan passes that disagree
`outline`         the outline: an α-shape
`offset`          heights along the blade's normal
`distortion`      how the frame stretches and shears
`blade`           all of it together
`frame_loops`     stations of the frame, closest points on the axis
`offset_loops`    the blade's normal and curvature
"""
