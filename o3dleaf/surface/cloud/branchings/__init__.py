"""Lines along which three or more sheets of a cloud meet: found, and told from creases, corners and thin sheets.

`branchings`  `Branchings`: where sheets meet, and what is cut there
`axes`        lines through which the planes of neighborhoods pass
`axis_loops`  the compiled loops of such lines
`arms`        the sheets that leave such a line
`find`        `find_branchings`: all of it together
"""
