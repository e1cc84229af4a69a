"""Point clouds in: reading what a scanner wrote, taking out what is no surface, and telling outside from inside."""

from o3dleaf.cloud.constraints import off_surface_constraints
from o3dleaf.cloud.merging import merge_points
from o3dleaf.cloud.orientation import Orientation, estimate_normals, orient_normals
from o3dleaf.cloud.oriented import OrientedCloud, prepare_cloud
from o3dleaf.cloud.prepare import remove_stray_points
from o3dleaf.cloud.read import read_point_cloud
from o3dleaf.cloud.spacing import cloud_spacing
from o3dleaf.cloud.stray import find_stray_points

__all__ = [
    "Orientation",
    "OrientedCloud",
    "cloud_spacing",
    "estimate_normals",
    "find_stray_points",
    "merge_points",
    "off_surface_constraints",
    "orient_normals",
    "prepare_cloud",
    "read_point_cloud",
    "remove_stray_points",
]
