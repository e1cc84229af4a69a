"""What a sheet leaves out of its scan, and where it comes apart.

`leftovers`  pieces, layers and branchings that a sheet leaves out
`necks`      parts of a sheet that hang together by little, as leaves that touch
`slits`      gaps between the margins of a leaf that is rolled up
"""
