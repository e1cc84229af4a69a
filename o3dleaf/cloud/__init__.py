"""Point clouds in: reading what a scanner wrote, checking it, and taking out what is not leaf."""

from o3dleaf.cloud.prepare import remove_stray_points
from o3dleaf.cloud.read import read_point_cloud

__all__ = ["read_point_cloud", "remove_stray_points"]
