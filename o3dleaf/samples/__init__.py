"""Synthetic leaves, seeded, with the truth kept as a Field: a scan and a micro-CT volume to try everything on."""

from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.files import write_samples
from o3dleaf.samples.micro import WheatPatch
from o3dleaf.samples.scan import ScanSample, wheat_scan
from o3dleaf.samples.sheet import WheatBlade

__all__ = ["ScanSample", "WheatBlade", "WheatPatch", "wheat_ct", "wheat_scan", "write_samples"]
