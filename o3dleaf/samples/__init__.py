"""Synthetic leaves and solids, seeded, with the truth kept as a Field: scans, volumes, clouds to try things on.

`domain`  the box a truth is defined on
`sheet`   a wheat blade
`scan`    its laser scan
`micro`   the micro-structure of a wheat patch
`ct`      its micro-CT
`files`   all of it as files
`solids`  sphere, torus, block, feet
`meshed`  solids meshed finely
`slab`    a wavy sheet
`figure`  a figure of many parts
`wires`   round-ended wires side by side
`mesh_solid` the solid within a closed mesh
`narrow`  fins, a gap, a fold, bumps
`leaves`  leaves of any shape: curled, twisted, eaten, lobed, on a petiole
"""

from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.figure import Figure
from o3dleaf.samples.files import write_samples
from o3dleaf.samples.leaves.kinds import LEAF_KINDS, leaf_shape
from o3dleaf.samples.leaves.leaf_scan import LeafScan, scan_leaf
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.scan_files import write_leaf_scans
from o3dleaf.samples.mesh_solid import MeshSolid
from o3dleaf.samples.micro import WheatPatch
from o3dleaf.samples.narrow import bumps, fins, fold, gap
from o3dleaf.samples.scan import ScanSample, wheat_scan
from o3dleaf.samples.sheet import WheatBlade
from o3dleaf.samples.slab import WavySheet
from o3dleaf.samples.solids import Block, Feet, Solid, Sphere, Torus
from o3dleaf.samples.wires import Wires

__all__ = [
    "LEAF_KINDS",
    "Block",
    "Feet",
    "Figure",
    "LeafScan",
    "LeafShape",
    "MeshSolid",
    "ScanSample",
    "Solid",
    "Sphere",
    "Torus",
    "WavySheet",
    "WheatBlade",
    "WheatPatch",
    "Wires",
    "bumps",
    "fins",
    "fold",
    "gap",
    "leaf_shape",
    "scan_leaf",
    "wheat_ct",
    "wheat_scan",
    "write_leaf_scans",
    "write_samples",
]
