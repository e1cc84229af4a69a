"""Pictures of meshes on any machine, and the interactive window where there is a screen.

`camera`   what the picture shows: a mesh's principal axes, tilted, fitted to a panel
`shade`    light: Open3D's ray casting on the CPU, shadows, ambient occlusion, no GPU and no Vulkan
`render`   the page: the leaf, insets of its micro-structure, scale bars, colour bar, title
`panel`    the furniture of the page, drawn by Matplotlib
`window`   Open3D's own viewer
"""
