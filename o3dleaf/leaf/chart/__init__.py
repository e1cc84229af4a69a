"""The chart: a sheet laid flat, its ends, its midrib and its petiole.

`flattening`   maps of a sheet to the plane, and what is asked of it
`axis`         the ends of a blade in the plane, sections across it
`stalk`        a stalk among points, and where it widens into the blade
`carry`        values and parameters of a sheet at points near it
`flatten`      `lay_flat`: the chart of a sheet
`petiole`      the petiole, by its cross-section
`midline`      the midrib in the chart
`turn`         the chart turned so that the midrib lies along u
`sheet_chart`  `chart_sheet`: all of it together
"""
