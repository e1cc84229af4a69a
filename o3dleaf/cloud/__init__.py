"""Point clouds in: reading what a scanner wrote, taking out what is no surface, and telling outside from inside."""

from o3dleaf.cloud.constraints import off_surface_constraints
from o3dleaf.cloud.oriented import OrientedCloud, prepare_cloud
from o3dleaf.cloud.prepare import remove_stray_points
from o3dleaf.cloud.read import read_point_cloud
from o3dleaf.cloud.spacing import cloud_spacing

__all__ = [
    "OrientedCloud",
    "cloud_spacing",
    "off_surface_constraints",
    "prepare_cloud",
    "read_point_cloud",
    "remove_stray_points",
]
