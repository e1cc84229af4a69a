"""Two leaves of known shape of which one rests on the other, and a scan of both that says which points are whose."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial.transform import Rotation

from o3dleaf.samples.leaves.leaf_pair_scan import MESH_STEP, LeafPairScan, Pose, scan_leaf_pair
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.outlines import long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep

MIDDLE, TIP = 0.5, 0.93
"""Of the upper leaf's length, the place that is laid onto the lower one."""
GAPS, NOISES = (0.0, 0.5, 1.0, 2.0), (0.0, 0.2, 0.5)
FRAGMENT_GAPS, FRAGMENT_NOISES = (0.0, 1.0, 2.0, 3.0), (0.0, 0.1, 0.25, 0.4)


@dataclass(frozen=True, kw_only=True)
class RestingLeaves:
    """A leaf that rests on an arched one, and how both are scanned; millimeters and degrees, gap and noise in spacings.

    Attributes
    ----------
    tip : bool
        Whether its tip rests there, else its middle.
    hidden : bool
        Whether of the lower leaf nothing is seen under the upper one, as from above, else all of it.
    gap : float
        Least distance of the two, upright.
    noise : float
    angle, tilt : float
        Between their midribs, seen from above; and by which the upper one rises towards its base if its tip rests.
    lengths, widths : (2,) tuples
        Of the lower leaf and the upper.
    ovals : (2,) tuple of bool
        Which are ellipses; the others have a sharp tip.
    arch, bend, curl : float
        By which the lower leaf bends down along its length, and the upper one up along it, and across half of it.
    shift : (2,) tuple
        Of the place where it rests from the lower leaf's middle, of its length and width.
    spacing : float
    seed : int
    """

    tip: bool = False
    hidden: bool = True
    gap: float = 0.0
    noise: float = 0.0
    angle: float = 60.0
    tilt: float = 10.0
    lengths: tuple[float, float] = (80.0, 75.0)
    widths: tuple[float, float] = (32.0, 30.0)
    ovals: tuple[bool, bool] = (False, False)
    arch: float = 45.0
    bend: float = 20.0
    curl: float = 25.0
    shift: tuple[float, float] = (0.0, 0.0)
    spacing: float = 0.8
    seed: int = 0

    def scan(self) -> LeafPairScan:
        """Return the points of both."""
        rng = np.random.default_rng(self.seed)
        outlines = [
            (oval_outline if oval else long_outline)(length, width)
            for oval, length, width in zip(self.ovals, self.lengths, self.widths, strict=True)
        ]
        lower = LeafShape("curled", Sweep(self.lengths[0], arch=(-np.radians(self.arch), 0.0)), outlines[0])
        curl = 2 * np.radians(self.curl) / self.widths[1]
        upper = LeafShape("curled", Sweep(self.lengths[1], arch=(np.radians(self.bend), 0.0), curl=curl), outlines[1])
        place = (0.5 + self.shift[0]) * self.lengths[0], self.shift[1] * self.widths[0]
        below = Pose.of(lower, place, np.eye(3))
        turn = Rotation.from_euler("ZY", [self.angle, self.tilt if self.tip else 0.0], degrees=True).as_matrix()
        above = Pose.of(upper, ((TIP if self.tip else MIDDLE) * self.lengths[1], 0.0), turn)
        ground, over = below.moved(lower.mesh(MESH_STEP)[0]), above.moved(upper.mesh(MESH_STEP)[0])
        height = over[:, 2] - LinearNDInterpolator(ground[:, :2], ground[:, 2])(over[:, :2])
        spacings, lift = np.full(2, self.spacing), self.gap * self.spacing - float(np.nanmin(height))
        noise = self.noise * self.spacing
        poses = below, above
        return scan_leaf_pair((lower, upper), poses, lift, spacings, hidden=self.hidden, noise=noise, rng=rng)


def drawn_leaves(number: int, *, held_out: bool = False) -> RestingLeaves:
    """Return one of a family: tips and middles, both views, gaps and noises in turn, all else by chance."""
    rng = np.random.default_rng((7000 if held_out else 100) + number)
    return RestingLeaves(
        tip=number % 2 == 1,
        hidden=number // 2 % 2 == 0,
        gap=GAPS[number // 4 % 4],
        noise=NOISES[number % 3],
        angle=rng.uniform(30, 90),
        tilt=rng.uniform(5, 20),
        arch=rng.uniform(20, 70),
        bend=rng.uniform(5, 35),
        curl=rng.uniform(5, 50),
        lengths=(rng.uniform(60, 90), rng.uniform(60, 90)),
        widths=(rng.uniform(24, 40), rng.uniform(24, 40)),
        ovals=(rng.random() < 0.5, rng.random() < 0.5),
        shift=(rng.uniform(-0.15, 0.15), rng.uniform(-0.15, 0.15)),
        seed=number + (500 if held_out else 0),
    )


def drawn_fragment(number: int, *, held_out: bool = False) -> RestingLeaves:
    """Return a leaf and a fragment of another one on it, of 2 to 9 % of its area; views, gaps, noises in turn."""
    rng = np.random.default_rng((9000 if held_out else 300) + number)
    leaves = drawn_leaves(number, held_out=held_out)
    length, width = leaves.lengths[0], leaves.widths[0]
    slender = rng.uniform(1.2, 3.3)
    broad = np.sqrt(rng.uniform(0.02, 0.09) * length * width / slender)
    return replace(
        leaves,
        gap=FRAGMENT_GAPS[number // 4 % 4],
        noise=FRAGMENT_NOISES[number // 16 % 4],
        tilt=rng.uniform(5, 30),
        lengths=(length, slender * broad),
        widths=(width, broad),
        shift=(rng.uniform(-0.35, 0.35), rng.uniform(-0.35, 0.35)),
    )
