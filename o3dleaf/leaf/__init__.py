"""The leaf: its midrib, the frame along it, the height map, the outline, and the tiled micro-structure on it.

A point of the world becomes (along, across, up); the blade is a height over (along, across); the
micro-structure repeats over that plane. Composed, they are one implicit function of the whole leaf.
"""
