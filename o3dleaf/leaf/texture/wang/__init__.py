"""Wang tiles: sixteen tiles cut out of patches, laid over the plane without repetition.

`corners`     colors of the plane's corners, and the tile that four of them call for
`least_cut`   the cut along which two contents differ least
`quilt`       the place of a patch that each node of each tile shows, and its weight
`spots`       places of patches, and at which of them one differs least from what it is laid over
`quilting`    tiles cut out of patches
`wang_field`  the field of the tiles
"""
