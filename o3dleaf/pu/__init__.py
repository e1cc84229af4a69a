"""Many balls: an adaptive cover, a local fit in each ball, and Shepard's blend of them all.

The chapter turns the previous one's local interpolant into a function of any number of points at a
cost that grows with their number: each ball is small, and a query meets only the few that hold it.
"""
