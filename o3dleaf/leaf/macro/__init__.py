"""The blade: the macro-scale leaf of the scan.

`midrib`          detection of the midrib
`midrib_normals`  normals along it
`frame`           (along, across, up) about the midrib
`frame_quality`   diagnostics of a frame
`height`          the height map H
`robust`          a height through scan passes that disagree
`outline`         the outline: an α-shape
`lift`            from flat coordinates to the world, with the Jacobian
`offset`          heights along the blade's normal
`distortion`      stretch and shear of what lies on the blade
`blade`           all of it together
`frame_loops`     stations of the frame, closest points on the axis
`lift_loops`      the lift's Jacobian, steps of Newton's method
`offset_loops`    the blade's normal and curvature
"""
