"""Two leaves of known shape that cross, one behind the other or through it, and a scan that says which is whose."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from o3dleaf.samples.leaves.leaf_pair_scan import LeafPairScan, Pose, scan_leaf_pair
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.outlines import long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep

GAPS, NOISES, DENSITIES = (0.0, 1.0, 2.0, 3.0, 5.0, 8.0), (0.0, 0.2, 0.5), (1.0, 2.0)


@dataclass(frozen=True, kw_only=True)
class CrossingLeaves:
    """A leaf over another one, as an X from above; millimeters and degrees, gap and noise in spacings.

    Attributes
    ----------
    hidden : bool
        Whether of the lower leaf nothing is seen under the upper one, as from above, else all of it.
    gap : float
        From the lower leaf's surface to the upper one's, where they cross.
    tilt : float
        By which the upper one rises along its length, from one side of the lower one to the other.
    noise : float
    density : float
        Points of the lower leaf on a unit of area over those of the upper one.
    angle : float
        Between their midribs, seen from above.
    lengths, widths : (2,) tuples
        Of the lower leaf and the upper.
    ovals : (2,) tuple of bool
        Which are ellipses; the others have a sharp tip.
    arches, curls : (2,) tuples
        By which each leaf bends down along its length, and up across half its width.
    shifts : (2,) tuple
        Of the place where they cross from the middle of each, of its length.
    spacing : float
        Of the upper leaf.
    seed : int
    """

    hidden: bool = False
    gap: float = 2.0
    tilt: float = 0.0
    noise: float = 0.0
    density: float = 1.0
    angle: float = 60.0
    lengths: tuple[float, float] = (80.0, 75.0)
    widths: tuple[float, float] = (14.0, 12.0)
    ovals: tuple[bool, bool] = (False, False)
    arches: tuple[float, float] = (30.0, 30.0)
    curls: tuple[float, float] = (10.0, 10.0)
    shifts: tuple[float, float] = (0.0, 0.0)
    spacing: float = 0.8
    seed: int = 0

    def scan(self) -> LeafPairScan:
        """Return the points of both."""
        rng = np.random.default_rng(self.seed)
        leaves = [self._leaf(number) for number in range(2)]
        turn = Rotation.from_euler("ZY", [self.angle, self.tilt], degrees=True).as_matrix()
        poses = [
            Pose.of(leaf, ((0.5 + shift) * length, 0.0), motion)
            for leaf, shift, length, motion in zip(leaves, self.shifts, self.lengths, (np.eye(3), turn), strict=True)
        ]
        spacings = np.array([self.spacing / np.sqrt(self.density), self.spacing])
        lift, noise = self.gap * self.spacing, self.noise * self.spacing
        return scan_leaf_pair(leaves, poses, lift, spacings, hidden=self.hidden, noise=noise, rng=rng)

    def _leaf(self, number: int) -> LeafShape:
        length, width = self.lengths[number], self.widths[number]
        curl = 2 * np.radians(self.curls[number]) / width
        outline = (oval_outline if self.ovals[number] else long_outline)(length, width)
        return LeafShape("curled", Sweep(length, arch=(-np.radians(self.arches[number]), 0.0), curl=curl), outline)


def drawn_crossing(number: int, *, held_out: bool = False) -> CrossingLeaves:
    """Return one of a family: gaps, noises, densities, both views and tilts in turn, all else by chance."""
    rng = np.random.default_rng((9000 if held_out else 300) + number)
    return CrossingLeaves(
        hidden=number // 2 % 4 == 3,
        gap=GAPS[number % 6],
        noise=NOISES[number // 6 % 3],
        density=DENSITIES[number // 3 % 2],
        tilt=rng.uniform(-15, 15) if number % 4 < 2 else 0.0,
        angle=rng.uniform(25, 90),
        lengths=(rng.uniform(60, 90), rng.uniform(60, 90)),
        widths=(rng.uniform(8, 22), rng.uniform(8, 22)),
        ovals=(rng.random() < 0.5, rng.random() < 0.5),
        arches=(rng.uniform(-40, 40), rng.uniform(-40, 40)),
        curls=(rng.uniform(-30, 30), rng.uniform(-30, 30)),
        shifts=(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2)),
        seed=number + (700 if held_out else 0),
    )


def drawn_flush(number: int, *, held_out: bool = False) -> CrossingLeaves:
    """Return one of a family of which the upper leaf hides the lower one that it touches: gaps and noises in turn."""
    rng = np.random.default_rng((66_000 if held_out else 8100) + number)
    return CrossingLeaves(
        hidden=True,
        gap=(0.0, 0.5, 1.0)[number % 3],
        noise=NOISES[number // 3 % 3],
        angle=rng.uniform(35, 90),
        lengths=(rng.uniform(60, 90), rng.uniform(60, 90)),
        widths=(rng.uniform(6, 14), rng.uniform(6, 14)),
        ovals=(rng.random() < 0.5, rng.random() < 0.5),
        arches=(rng.uniform(-40, 40), rng.uniform(-40, 40)),
        curls=(rng.uniform(-15, 15), rng.uniform(-15, 15)),
        shifts=(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2)),
        seed=number,
    )
