"""A periodic surface, polygonized once and set down everywhere inside an outline, block by block into a file.

A tile is periodic along the first two axes, and a function takes flat coordinates to the world.

`runs`         what counts as inside: voids filled, specks removed, column by column
`tile`         one period of the surface, its vertices named by the edges of the lattice
`footprint`    which cells of the plane the outline contains, and how far columns are from its edge
`placement`    what of a tile is used in one place: whole cells inside the outline, or a solid that it cuts
`reduced`      a tile simplified or remeshed, its border locked
`parts`        the pieces that a placement falls into
`assembly`     numbers for every vertex and triangle of the whole, before one of them is written
`block`        one flat period as a closed block with matching walls
`levels`       finer windows set into a coarser surface
`stream`       PLY, STL and OBJ written at known places, whole or not at all
`tile_loops`   runs along columns and edges of one period
`plane_loops`  an outline over cells and columns
`rim_loops`    where an outline cuts a tile
"""
