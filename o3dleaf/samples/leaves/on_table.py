"""Leaves of known shape scanned with a table, which they lie on, hang over or stand on; and pressed ones without."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.samples.leaves.kinds import leaf_shape
from o3dleaf.samples.leaves.leaf_scan import draw_places, scan_leaf

KINDS: dict[str, dict[str, float]] = {
    "lobed": {"length": 60.0, "width": 50.0},
    "eaten": {"length": 60.0, "width": 24.0},
    "cupped": {"length": 50.0, "width": 36.0, "radius": 45.0},
    "curled": {"length": 90.0, "width": 20.0, "angle": 70.0},
    "twisted": {"length": 90.0, "width": 14.0, "angle": 100.0},
    "petiole": {"length": 45.0, "width": 28.0, "stalk": 30.0, "stub": 12.0},
}
POSES = ("lying", "over", "standing")
GAPS, NOISES = (0.0, 1.0, 3.0, 9.0, 20.0, 60.0), (0.0, 0.1, 0.3, 0.5)
ON_LEAF = ("bare", "midrib", "tape", "two leaves", "scraps", "bent end")
"""What a pressed leaf has."""
LEAST_TABLE = 25.0
"""Half the width of a table of size 1, at least, in millimeters."""
CLIP = 4.0, 6.0
"""Radius and least height of a clip, in millimeters."""


class TableScan(NamedTuple):
    """Points (n, 3), and what each is of (n,): 0 the table, 1 the leaf, 2 a clip."""

    points: FloatArray
    what: IntArray


@dataclass(frozen=True, kw_only=True)
class LeafOnTable:
    """A leaf and a table; millimeters, gap and noise in spacings.

    Attributes
    ----------
    kind : str
        Of `KINDS`.
    pose : {"lying", "over", "standing"}
        Flat, nearly flat, upright.
    gap : float
        Of the leaf's lowest point above the table.
    noise, spacing : float
    size : float
        Half the table's width over that of the leaf, seen from above.
    is_round, is_hidden, has_clip : bool
        Whether the table is a disk, else a rectangle; is not seen under the leaf; holds a clip at the leaf's foot.
    density : float
        Of the table's points, over the leaf's; of lengths.
    bow : float
        Height of the table's rim over its half width: it is a paraboloid.
    shift : (2,) tuple of float
        Of the leaf, in half widths of the table.
    seed : int
    """

    kind: str = "lobed"
    pose: str = "over"
    gap: float = 9.0
    noise: float = 0.0
    size: float = 2.0
    is_round: bool = True
    is_hidden: bool = True
    has_clip: bool = False
    density: float = 1.0
    bow: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    spacing: float = 1.0
    seed: int = 0

    def scan(self) -> TableScan:
        """Return the points of all, turned and moved at random."""
        rng = np.random.default_rng(self.seed)
        leaf = self._leaf(rng)
        reach = self.size * max(LEAST_TABLE, float(np.abs(leaf[:, :2]).max()))
        leaf += [*(np.array(self.shift) * reach), 0.0]
        parts = [self._table(leaf, reach, rng), leaf]
        if self.has_clip:
            parts.append(_clip(leaf, self.spacing, rng))
        points, what = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        points += rng.normal(0, self.noise * self.spacing, points.shape)
        return TableScan(Rotation.random(random_state=rng).apply(points) + rng.uniform(-100, 100, 3), what)

    def _leaf(self, rng: np.random.Generator) -> FloatArray:
        """Return the points (n, 3) of the leaf in its pose, its middle over the origin."""
        points = scan_leaf(leaf_shape(self.kind, **KINDS[self.kind]), spacing=self.spacing, seed=self.seed).points
        points -= points.mean(axis=0)
        points = points @ np.linalg.svd(points, full_matrices=False)[2].T  # longest along x, flattest along z
        if self.pose == "standing":
            points = Rotation.from_euler("y", rng.uniform(-30, 30), degrees=True).apply(points[:, [2, 1, 0]])
        elif self.pose == "over":
            points = Rotation.from_euler("xy", rng.uniform(-25, 25, 2), degrees=True).apply(points)
        return np.asarray(points - [*points[:, :2].mean(axis=0), points[:, 2].min() - self.gap * self.spacing])

    def _table(self, leaf: FloatArray, reach: float, rng: np.random.Generator) -> FloatArray:
        """Return the points (n, 3) of the table."""
        places = rng.uniform(-reach, reach, (int((2 * reach * self.density / self.spacing) ** 2), 2))
        away = np.linalg.norm(places, axis=1) / reach
        seen = away <= 1 if self.is_round else np.abs(places[:, 1]) <= 0.7 * reach
        if self.is_hidden:
            seen &= cKDTree(leaf[:, :2]).query(places)[0] > self.spacing
        return np.column_stack([places, self.bow * reach * away**2])[seen]


def _clip(leaf: FloatArray, spacing: float, rng: np.random.Generator) -> FloatArray:
    """Return the points (n, 3) of a tube that stands on the table and holds a leaf at its lowest point."""
    radius, low = CLIP[0], leaf[leaf[:, 2].argmin()]
    height = max(float(low[2]), CLIP[1])
    turn, up = rng.uniform([[0.0], [0.0]], [[2 * np.pi], [height]], (2, int(2 * np.pi * radius * height / spacing**2)))
    return np.column_stack([low[0] + radius * np.cos(turn), low[1] + radius * np.sin(turn), up])


def drawn_table(number: int, *, held_out: bool = False) -> LeafOnTable:
    """Return one of a family: kinds and poses in turn, all else by chance."""
    rng = np.random.default_rng((9000 if held_out else 300) + number)
    return LeafOnTable(
        kind=list(KINDS)[number % 6],
        pose=POSES[number // 2 % 3],
        gap=GAPS[rng.integers(6)],
        noise=NOISES[rng.integers(4)],
        size=rng.uniform(0.8, 2.5),
        is_round=bool(rng.random() < 0.5),
        is_hidden=bool(rng.random() < 0.7),
        has_clip=bool(rng.random() < 0.3),
        density=(1.0, 1.0, 0.7, 1.4)[rng.integers(4)],
        bow=(0.0, 0.0, 0.002, 0.005)[rng.integers(4)],
        shift=(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)),
        seed=number + (500 if held_out else 0),
    )


def drawn_pressed(number: int, *, held_out: bool = False) -> tuple[str, FloatArray]:
    """Return what one of a family of leaves pressed flat has, of `ON_LEAF`, and its points (n, 3): none has a table."""
    rng = np.random.default_rng((19000 if held_out else 700) + number)
    kind, has = list(KINDS)[number % 5], ON_LEAF[number // 5 % 6]
    leaf = leaf_shape(kind, **KINDS[kind])
    flat = draw_places(leaf, 1.0, "random", rng)
    length, middle = float(flat[:, 0].max()), flat[rng.integers(len(flat), size=4)]
    points = np.pad(flat, ((0, 0), (0, 1)))
    if has == "midrib":
        narrowed = np.clip(1 - flat[:, 0] / length, 0.05, 1)
        points[:, 2] = rng.uniform(0.5, 2.0) * narrowed * np.exp(-((flat[:, 1] / (rng.uniform(1, 2) * narrowed)) ** 2))
    elif has == "tape":
        height = rng.uniform(0.3, 1.5)
        for strip, at in zip(rng.uniform([-15, -2, height], [15, 2, height], (2, 120, 3)), middle, strict=False):
            turn = Rotation.from_euler("z", rng.uniform(0, np.pi))
            points = np.concatenate([points, turn.apply(strip) + np.append(at, 0.0)])
    elif has == "two leaves":
        points = np.concatenate([points, points + np.array([0.0, np.ptp(flat[:, 1]) + 12, 0.0])])
    elif has == "scraps":
        away = np.column_stack([middle + rng.uniform(-60, 60, (4, 2)), rng.uniform(0, 12, 4)])
        scraps = rng.uniform([-4, -4, 0], [4, 4, 0], (4, 64, 3)) + away[:, np.newaxis]
        points = np.concatenate([points, scraps.reshape(-1, 3)])
    elif has == "bent end":
        past, radius = np.maximum(flat[:, 0] - rng.uniform(0.4, 0.8) * length, 0), rng.uniform(6, 20)
        points += np.column_stack(
            [radius * np.sin(past / radius) - past, np.zeros(len(past)), radius * (1 - np.cos(past / radius))]
        )
    points += rng.normal(0, NOISES[rng.integers(4)], points.shape)
    return f"{kind}, {has}", np.asarray(Rotation.random(random_state=rng).apply(points))
