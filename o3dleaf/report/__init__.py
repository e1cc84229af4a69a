"""What is known of a mesh, a file or a run, for people (a page) and for programs (JSON).

`summary`       what a run says of itself: settings, units, sizes, times, versions
`describe`      what a file holds
`requirements`  what a mesh must be, in words such as "watertight,components=1,min-angle=10", and whether it is
"""

from o3dleaf.report.describe import describe_file, read_geometry, write_json
from o3dleaf.report.summary import summarise

__all__ = ["describe_file", "read_geometry", "summarise", "write_json"]
