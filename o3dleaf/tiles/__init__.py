"""A periodic surface, polygonised once and set down everywhere inside an outline, block by block into a file.

`runs`       what counts as inside: voids filled, specks removed, column by column
`tile`       one period of the surface, its vertices named by the edges of the lattice
`footprint`  which cells of the plane the outline holds, and how far columns are from its edge
`placement`  what of a tile is used in one place, and which pieces hang together
`assembly`   numbers for every vertex and triangle of the whole, before one of them is written
`stream`     the files: PLY, STL and OBJ written at known places, whole or not at all

Nothing here knows a leaf: a tile is periodic along the first two axes, and a function takes flat
coordinates to the world.
"""
