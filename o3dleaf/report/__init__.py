"""What is known of a mesh, a file or a run, for people (a page) and for programs (JSON).

`summary`       what a run says of itself: settings, units, sizes, times, versions
`describe`      what a file holds
`words`         figures with their names, kinds and units
`requirements`  what a mesh must be, "watertight,components=1,min-angle=10", and whether it is
`examine`       a mesh examined: figures, verdict, JSON and page
`compose`       the parts of the page; `page` puts them together, with `page.css`
`reduce`        fewer triangles, to look at
`places`        where the defects are, and from where to look at them
`closeups`, `overviews`, `charts`   what is drawn, shaded by `shots`
`viewer`        the data of the interactive view, which `viewer.js` draws
"""

from o3dleaf.report.describe import describe_file, read_geometry, write_json
from o3dleaf.report.summary import summarise

__all__ = ["describe_file", "read_geometry", "summarise", "write_json"]
