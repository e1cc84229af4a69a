"""What a sheet leaves out of its scan, and where it comes apart.

`leftovers`       pieces, layers and branchings that a sheet leaves out
`table`           a table or a wall, and what rises from it
`peaks`           parts of a sheet, each with a peak of a function on it
`necks`           parts of a sheet that hang together by little, as leaves that touch
`tube_ends`       boundary loops that are ends of a tube
`blades`          blades that leave a tube, as a sheath
`resting`         leaves of which one lies on another
`fragment`        fragments of other sheets that lie on a leaf
`arms`            the four arms of leaves that cross, by the rim of both
`crossing`        leaves that cross, parted
`leaf_pair`       two leaves of one sheet, and what is said of them
`minimum_cut`     points parted where the fewest links between neighbors are cut
`nearer_surface`  points told apart by which of two surfaces they are nearer to
`nearer_loops`    the compiled loop of heights over surfaces
`slits`           gaps between the margins of a leaf that is rolled up
"""
