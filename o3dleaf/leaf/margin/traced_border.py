"""Whether the border of a planar sample is drawn along the leaf's margin, as a mesh's vertices are, or cut by it."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation

HALF_WINDOW = 3
"""Points to either side of one that the curve beside it is fitted to: a parabola, with four degrees of freedom left."""
MIN_BORDER = 4 * HALF_WINDOW
"""Points of a border, at least, that say how it runs."""
EXACT = 0.01
"""Spacings from its curve that count as none: no area hangs on them, and roundings of a lattice's rows are less."""
MAX_STEP = 2 / 3
"""Spacings between points of a border, in the mean, below which they are no row of the sample: in its own metric a
lattice is made of equilateral triangles or of squares, and its closest rows have steps of 1.07 or 1."""
FLAT = 0.1
"""Height in spacings of triangles at the border up to which their third point is one of its points: points on a line,
but for a rounding, are the corners of such, and the border passes most of them by."""
MIN_RATIO = 4.0
"""Times that residuals are smaller than by chance: variances of a dozen have a ratio of sixteen once in 50,000."""


@dataclass(frozen=True)
class Border:
    """How the border of a sample runs, in spacings of the points deep inside and by their metric.

    Attributes
    ----------
    residual : float
        Median distance of its points from the parabola through their neighbors along it; at least `EXACT`.
    rows : float
        Median distance from a side of the border, moved one triangle inwards, to the point nearest to its end. It is
        as small as the residual where rows of the sample run along the margin.
    step : float
        Mean side ℓ of the border.
    """

    residual: float
    rows: float
    step: float

    @property
    def chance(self) -> float:
        """The residual where the border is cut out of a sample: 1/(4 ℓ).

        Its points are no denser in the strip that holds half of them than the sample is.
        """
        return 0.25 / self.step

    @property
    def smooth(self) -> bool:
        """Whether its points lie on a smooth curve more exactly than those of a cut lattice or random sample."""
        return MIN_RATIO * self.residual <= self.chance

    @property
    def traced(self) -> bool:
        """Whether they do, and no row inside is as smooth and as dense: they were set on the margin itself."""
        return self.smooth and (MIN_RATIO * self.residual <= self.rows or self.step <= MAX_STEP)

    def note(self, added: float) -> str:
        """Return in words where a leaf ends whose outermost points lie on a smooth curve; `added` is a share of it."""
        said = "the outermost points lie on a smooth curve, as vertices of a mesh do"
        if self.traced:
            return f"{said}, and rows inside do not or are sparser: the margin runs through them"
        told = f"{added:.1%} of the area is added beyond them, half a cell each"
        return f"{said}, and rows of a scan along a margin: {told}, which vertices of a mesh would not need"


def border_of(mesh: Triangulation, kept: BoolArray, deep: BoolArray, spacing: FloatArray) -> Border | None:
    """Return how the border of the triangles kept runs; None where it is too short to tell.

    Parameters
    ----------
    mesh : Triangulation
    kept : (m,) bool ndarray
        Its triangles that the sample covers.
    deep : (n,) bool ndarray
        The points that no border has cut. Their metric is taken at the border, where dense points would set their own.
    spacing : (n,) ndarray
        Square root of the area that a point stands for.
    """
    inner = np.flatnonzero(deep)
    nearest = inner[cKDTree(mesh.points[inner]).query(mesh.points)[1]]
    metrics = mesh.metric[nearest] / spacing[:, None] ** 2
    _, begin, end, behind = _sides(mesh, _without_flat(mesh, kept, metrics))
    # At points where the border meets itself it has no one course.
    once = (np.bincount(begin, minlength=len(spacing)) == 1) & (np.bincount(end, minlength=len(spacing)) == 1)
    if np.count_nonzero(once) < MIN_BORDER:
        return None
    metric = metrics[begin]
    sides = mesh.points[end] - mesh.points[begin]
    window = _windows(begin, end, once)
    around = window[(window >= 0).all(axis=1)]
    if len(around) < MIN_BORDER:
        return None
    place = np.zeros(len(spacing), dtype=np.int64)
    place[begin] = np.arange(len(begin))
    residual = _residuals(mesh.points[around], metric[place[around[:, HALF_WINDOW]]])
    used = np.unique(mesh.triangles[kept])
    return Border(
        max(float(np.median(residual)), EXACT),
        float(np.median(_astray(mesh.points, used, behind, sides, metric))),
        float(_lengths(sides, metric).mean()),
    )


def _sides(mesh: Triangulation, kept: BoolArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the triangle (k,) behind each side of the border of those kept (m,), its ends, and its third point."""
    row, corner = np.nonzero(kept[:, None] & ~np.append(kept, False)[mesh.neighbors])
    begin, end, behind = (mesh.triangles[row, (corner + turn) % 3] for turn in (1, 2, 0))
    return row, begin, end, behind


def _without_flat(mesh: Triangulation, kept: BoolArray, metric: FloatArray) -> BoolArray:
    """Return the triangles (m,) that are left when those go from the border outside in that are all but a line."""
    kept = kept.copy()
    while True:
        row, begin, end, behind = _sides(mesh, kept)
        side, to = mesh.points[end] - mesh.points[begin], mesh.points[behind] - mesh.points[begin]
        across = np.stack([-side[:, 1], side[:, 0]], axis=1) / np.hypot(*side.T)[:, None]
        height = np.einsum("kj,kj->k", to, across) * _lengths(across, metric[begin])
        flat = row[(np.abs(height) <= FLAT) & ~np.isin(behind, begin)]
        if not len(flat):
            return kept
        kept[flat] = False


def _windows(begin: IntArray, end: IntArray, once: BoolArray) -> IntArray:
    """Return the rows (k, 2 h + 1) of border points and of the h before and after each along it; −1 where unknown."""
    after, before = np.full(len(once) + 1, -1), np.full(len(once) + 1, -1)
    after[begin], before[end] = end, begin
    after[:-1][~once], before[:-1][~once] = -1, -1
    window = [np.flatnonzero(once)]
    for _ in range(HALF_WINDOW):
        window = [before[window[0]], *window, after[window[-1]]]
    return np.stack(window, axis=1)


def _residuals(windows: FloatArray, metric: FloatArray) -> FloatArray:
    """Return how far (k,) the middle one of (k, 2 h + 1, 2) points lies from a parabola through all, studentized."""
    local = windows - windows[:, [HALF_WINDOW]]
    chord = local[:, -1] - local[:, 0]
    length = np.hypot(*chord.T)
    along = chord / np.maximum(length, 1e-300)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    x = np.einsum("kij,kj->ki", local, along) / np.maximum(length, 1e-300)[:, None]
    y = np.einsum("kij,kj->ki", local, across)
    basis = np.linalg.qr(np.stack([np.ones_like(x), x, x**2], axis=2))[0]
    left = y - np.einsum("kij,klj,kl->ki", basis, basis, y)
    free = 1 - (basis[:, HALF_WINDOW] ** 2).sum(axis=1)
    scale = np.sqrt(np.maximum(free, 1e-3))
    residual: FloatArray = np.abs(left[:, HALF_WINDOW]) / scale * _lengths(across, metric)
    return residual


def _astray(points: FloatArray, used: IntArray, behind: IntArray, sides: FloatArray, metric: FloatArray) -> FloatArray:
    """Return how far (k,) from the line of a side, moved to the point behind it, the point nearest to its end lies."""
    near = used[cKDTree(points[used]).query(points[behind] + sides, k=2)[1]]
    other = np.where(near[:, 0] == behind, near[:, 1], near[:, 0])
    across = np.stack([-sides[:, 1], sides[:, 0]], axis=1) / np.hypot(*sides.T)[:, None]
    away = np.abs(np.einsum("kj,kj->k", points[other] - points[behind], across))
    astray: FloatArray = away * _lengths(across, metric)
    return astray


def _lengths(vectors: FloatArray, metric: FloatArray) -> FloatArray:
    """Return the lengths (k,) of (k, 2) vectors in a metric (k, 3) for each."""
    x, y = vectors.T
    length: FloatArray = np.sqrt(metric[:, 0] * x**2 + 2 * metric[:, 1] * x * y + metric[:, 2] * y**2)
    return length
