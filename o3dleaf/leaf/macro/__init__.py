"""The paper's blade: a height map over a midrib's plane, inside an α-shape.

`midrib`          detection of the midrib
`midrib_normals`  normals along it
`frame`           (along, across, up) about the midrib
`frame_quality`   diagnostics of a frame
`height`          the height map H
`noise`           the noise of points about their local planes, their density
`robust`          a height through scan passes that disagree
`outline`         the outline: an α-shape
`offset`          heights along the blade's normal
`lift`            from flat coordinates to the world, with the Jacobian, and heights at which that folds
`blade`           all of it together
`frame_loops`     stations of the frame, closest points on the axis
`lift_loops`      the lift and its Jacobian
`offset_loops`    the blade's normal and curvature
"""
