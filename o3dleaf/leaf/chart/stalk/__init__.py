"""The stalk of a leaf among its points: sections across it, and where it widens into the blade.

`point_ways`    distances along a cloud of points
`sections`      widths of the sections at equal distance from an end
`stretches`     which stretch of them is a stalk
`lobes`         ends of the leaf that look as it does
`stalk_points`  the points about the end of a stalk, along, across and above it
`kink_cost`     how well they agree with a stalk that ends at a place
`junction`      where a stalk widens into the blade
"""
