"""Hairs of a texture: found, laid over the plane, and removed where a map wants fewer.

`zones`      zones of tiles with hairs, and the surface beneath them
`laid_hairs` hairs in their places over the plane, and which of them are removed
`thinned`    a texture with fewer hairs
"""
