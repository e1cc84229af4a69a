"""The stalk of a leaf among its points: sections across it, and where it widens into the blade.

`point_ways`    distances along a cloud of points
`sections`      widths of the sections at equal distance from an end
`stretches`     the stretch of them that is a stalk
`lobes`         ends of the leaf that look as it does
`stalk_points`  the points about the end of a stalk, along, across and above it
`kink_loops`    the loop over points beside a stalk
`kink_cost`     their likelihood under a stalk that ends at a place
`junction`      the place where a stalk widens into the blade
`attachment`    how it is joined to that
"""
