"""Pictures of meshes and point clouds on any machine, and the interactive window where there is a screen.

The public names are loaded when they are first used; they stand in the stub beside this file, `__init__.pyi`.

`camera`     what the picture shows: a mesh's principal axes, tilted, fitted to a panel
`camera_loops`  compiled: how a mesh's triangles lie, and which pixels they reach
`points`     a point cloud as small spheres
`scene`      meshes and clouds together, and their colors
`film`       the pixels that a mesh covers: more samples where these differ, shared rays to the sky where not
`shade`      light: Open3D's ray casting on the CPU, shadows, ambient occlusion
`shade_loops`  compiled: normals, rays to the sky, the sums of pixels
`offscreen`  Open3D's renderer in a process of its own, where it works
`panel`      the furniture of the page, drawn by Matplotlib
`picture`    `render`: the leaf, insets of its micro-structure, scale bars, color bar, title
`leaf_picture`  the whole leaf, with an inset of its micro-structure; the pieces of a scan
`maps`       maps over the blade
`window`     Open3D's own viewer
`pick`       control points picked in it
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
