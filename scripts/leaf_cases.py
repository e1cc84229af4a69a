"""Leaves of known shape to judge a blade on: kinds, conditions of the scan, and those held out until the end."""

from dataclasses import dataclass, field

import o3dleaf as o3l

KINDS = {
    "curled": {},
    "arched": {"kind": "curled", "arch": 60},
    "rolled": {"kind": "curled", "angle": 165},
    "twisted": {},
    "wavy": {},
    "winding": {},
    "eaten": {},
    "lobed": {},
    "cupped": {},
    "petiole": {},
    "layers": {},
}
"""Names of leaves and what is changed of their kind, which is the name if no other is given."""

HELD_OUT = {
    "curled": {"angle": 95, "length": 150, "width": 18},
    "arched": {"kind": "curled", "angle": 80, "length": 90, "width": 30, "arch": 110},
    "rolled": {"kind": "curled", "angle": 157, "length": 150, "width": 18, "arch": 40},
    "twisted": {"angle": 250, "length": 180, "width": 12},
    "wavy": {"angle": 75, "length": 120, "width": 7},
    "winding": {"angle": 85, "length": 180, "width": 6},
    "eaten": {"length": 85, "width": 48, "hole": 13, "notch": 9, "arch": 35},
    "lobed": {"length": 60, "width": 80, "lobes": 7, "depth": 0.18, "arch": 40},
    "cupped": {"length": 75, "width": 40, "radius": 55},
    "petiole": {"length": 65, "width": 52, "stalk": 30, "stub": 22, "arch": 20},
    "layers": {"length": 100, "width": 30, "height": 0.7, "arch": 90},
}
"""The same with other angles, widths and outlines; nobody looks at them before all choices are made."""

CONDITIONS = {
    "clean": {},
    "noise 0.2": {"noise": 0.2},
    "noise 0.5": {"noise": 0.5},
    "normal 0.5": {"noise": 0.5, "direction": "normal"},
    "patches": {"noise": 0.2, "gaps": "patches"},
    "band": {"noise": 0.2, "gaps": "band"},
    "margin": {"noise": 0.2, "gaps": "margin"},
    "passes": {"noise": 0.2, "passes": 2},
    "passes 0.5": {"noise": 0.5, "passes": 2},
    "lines": {"noise": 0.2, "pattern": "lines"},
    "stripes": {"noise": 0.2, "pattern": "stripes"},
    "grid": {"noise": 0.0, "pattern": "grid"},
}
FILL = 6.0
"""Spacings up to which holes are asked to be filled where a scan has gaps: as wide, and a spacing to either side."""
COMPLETE = 15.0
"""Spacings from which on stretches of a margin are asked to be completed where one is hidden: longer than notches."""
SPACINGS = {"wavy": 0.5, "winding": 0.5}
"""In millimeters, where it is not `SPACING`: a leaf 5 mm wide has ten points across."""
SPACING = 0.7
HELD_OUT_SEED = 1000
HELD_OUT_SPACING = 0.9
"""Times the usual spacing."""


@dataclass
class Case:
    """A leaf under a condition; `scan` is made when it is asked for."""

    name: str
    condition: str
    seed: int
    shape: dict = field(default_factory=dict)
    spacing: float = SPACING

    @property
    def asked(self):
        """Options of the blade, in millimeters: what gaps leave is asked to be filled, hidden margins completed."""
        gaps = CONDITIONS[self.condition].get("gaps")
        if gaps is None:
            return {}
        hidden = {"complete_margin": COMPLETE * self.spacing} if gaps == "margin" else {}
        return {"fill_holes": FILL * self.spacing} | hidden

    def scan(self):
        """Return the scan of this case, with its truth."""
        parameters = dict(self.shape)
        leaf = o3l.samples.leaf_shape(parameters.pop("kind", self.name), **parameters)
        return o3l.samples.scan_leaf(leaf, seed=self.seed, spacing=self.spacing, **CONDITIONS[self.condition])


def cases(kinds, conditions, seeds, *, held_out=False):
    """Return the cases of some kinds, conditions and seeds, judged or held out."""
    shapes, shift, factor = (HELD_OUT, HELD_OUT_SEED, HELD_OUT_SPACING) if held_out else (KINDS, 0, 1.0)
    return [
        Case(name, condition, seed + shift, shapes[name], factor * SPACINGS.get(name, SPACING))
        for name in kinds
        for condition in conditions
        for seed in range(seeds)
    ]
