"""Winding numbers of clouds: softened dipoles, summed up by a tree, and normals that are consistent with them.

`enclosing`       signs of pieces that enclose a volume
`dipole_tree`     winding numbers that points with normals and areas make, their gradients, and how errors pull
`consistency`     normals at doubtful places found from the winding number of the whole
`closed`          closed surfaces whose neighbors do not show their sides
`dipoles`         the winding number anywhere off the points, by moments of the tree's nodes
`dipole_loops`    the compiled loops over the nodes of the tree
`expansion_loops` the compiled loops of those moments
"""
