"""A periodic surface, polygonized once and set down everywhere inside an outline, block by block into a file.

A tile is periodic along the first two axes, and a function takes flat coordinates to the world.

`runs`         the inside, column by column: voids filled, islands removed
`tile`         one period of the surface, its vertices named by the edges of the lattice
`extraction`   a tile from a field
`sets`         several tiles, of which each place has one, or parts of two
`footprint`    cells of the plane inside the outline, and distances of columns to its edge
`placement`    the part of a tile that one place uses: whole cells inside the outline, or a solid that it cuts
`reduced`      a tile simplified or remeshed, its border locked
`cut`          the same with its triangles cut along a smooth margin, and the wall over it
`components`   the components that a placement falls into, and the sides that its triangles face
`windows`      all places, two rows at a time
`assembly`     numbers for every vertex and triangle of the whole, before one of them is written
`block`        one flat period as a closed block with matching walls
`levels`       finer windows set into a coarser surface
`stitch`       two levels joined along the curtain between them
`tile_loops`   runs along columns and edges of one period
`plane_loops`  an outline over cells and columns
`rim_loops`    cuts of a tile by an outline
"""
