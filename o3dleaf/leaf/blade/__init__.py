"""What every room of the leaf knows of a blade, however its surface is described.

`vector_loops`    products of vectors
`lifted_loops`    gradients through the lift's Jacobian, steps of Newton's method
`lifted`          points of the world with the lift's Jacobian
`distortion`      stretch and shear of what lies on the blade
`outline_loops`   the closest places on an outline
`outline_area`    the area in the plane that a blade covers
`blade`           the blade
"""
