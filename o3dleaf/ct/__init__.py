"""Micro-CT volume in, (points, values) out: formats, threshold, alignment, samples."""

from o3dleaf.ct.align import align_blade
from o3dleaf.ct.box import inscribed_box
from o3dleaf.ct.formats import read_volume
from o3dleaf.ct.threshold import histogram_threshold
from o3dleaf.ct.tiff import write_volume
from o3dleaf.ct.volume import Volume, apply_transform

__all__ = [
    "Volume",
    "align_blade",
    "apply_transform",
    "histogram_threshold",
    "inscribed_box",
    "read_volume",
    "write_volume",
]
