"""The leaf: its midrib, the frame along it, the height map, the outline, and the micro-structure on it.

A point of the world becomes (along, across, up); the blade is a height over (along, across); the
micro-structure repeats over that plane. Composed, they are one implicit function of the whole leaf.

The blade       `midrib`, `normals`, `frame`, `height`, `robust`, `validation`, `outline`; together, `blade`
Its quality     `quality` of the frame, `distortion` of what lies on it, `offset` along up or the normal, `bends`
The leaf        `multiscale`, the implicit function; `realisation`, its surface as a mesh
Its surface     `surface`: projection, normals, curvature; `distance` to it, by `tile` (samples of one tile), `rim`
                (strips), `boxes` (a tree over the blade) and the compiled `search` and `newton`; `around`, where it
                cannot be; `grid`, on a regular grid in a file
"""
