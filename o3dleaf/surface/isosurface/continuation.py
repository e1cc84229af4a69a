"""Continuation: the cells that a surface crosses, followed from seeds across their faces."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.checks.voxels import as_mask
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.newton import project_to_level
from o3dleaf.core.trees import query
from o3dleaf.surface.isosurface.band.band import Band
from o3dleaf.surface.isosurface.band.band_surface import draw_band
from o3dleaf.surface.isosurface.octree.dual_surface import draw_dual
from o3dleaf.surface.isosurface.octree.octree_band import OctreeBand

SEED_BLOCK = 4
"""One seed is used of those in a block of so many cells along each axis; the band grows from one to the next."""

POINTS_PER_SEED = 36
"""Points of the lattice at which a field is evaluated for each seed: 31 to 37, on clouds as dense as the lattice."""

SHARES = (1, 8, 6)
"""About how long seeds, growing and drawing take."""

MAX_ITERATIONS = 3
"""Steps of a seed towards the surface; each squares what is left, so that three take a cell to rounding."""

TOLERANCE = 1e-3
"""Share of a cell: a seed whose last step was shorter lies on the surface."""

Within = float | Callable[[FloatArray], npt.NDArray[np.bool_]]
"""The reach of a band from its seeds, or a function of (n, 3) centers of cells that returns which are allowed."""


def continue_from_seeds(
    field: Field,
    step: FloatArray,
    seeds: FloatArray,
    level: float,
    *,
    within: Within | None,
    sharpen: bool,
    features: bool,
    box: FloatArray | None = None,
) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of the parts of a level set that seeds lie on; see `extract_isosurface`.

    They are closed where a `box` (2, 3) cuts them.
    """
    following, drawing = progress.split(sum(SHARES[:2]), SHARES[2])
    with following:
        continued = Continuation.of(field, step, seeds, level, within=within, box=box)
    with drawing:
        return continued.draw(sharpen=sharpen, features=features)


@dataclass
class Continuation:
    """The cells that the parts of a level set cross which seeds lie on, followed again where the field changes.

    Attributes
    ----------
    band : Band
    seeds : (n, 3) ndarray
        One in a block of cells.
    allowed : callable or None
        The test of the centers of cells, (n, 3).
    trusting : bool
        Whether the cells of seeds are taken without it.
    """

    band: Band
    seeds: FloatArray
    allowed: Callable[[FloatArray], BoolArray] | None
    trusting: bool

    @classmethod
    def of(
        cls,
        field: Field,
        step: FloatArray,
        seeds: FloatArray,
        level: float,
        *,
        within: Within | None,
        box: FloatArray | None = None,
    ) -> "Continuation":
        """Follow the surface, as `continue_from_seeds` does."""
        return cls._followed(Band.around(seeds, field, level, step, box), _thin(seeds, step), seeds, within)

    @classmethod
    def on_octree(
        cls,
        field: Field,
        steps: FloatArray,
        seeds: FloatArray,
        level: float,
        *,
        within: Within | None,
        box: FloatArray | None = None,
    ) -> "Continuation":
        """Follow the surface on leaves about as wide as the steps (n,) of the seeds (n, 3) around, see `OctreeBand`."""
        band = OctreeBand.on_steps(seeds, steps, field, level, box)
        return cls._followed(band, band.thinned(seeds), seeds, within)

    @classmethod
    def _followed(cls, band: Band, thin: FloatArray, seeds: FloatArray, within: Within | None) -> "Continuation":
        continued = cls(band, thin, _as_test(within, seeds), not callable(within))
        continued.band.expected = POINTS_PER_SEED * len(thin)
        continued._follow()
        return continued

    def change(
        self,
        field: Field,
        where: Callable[[FloatArray], BoolArray],
        within: Callable[[FloatArray], npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        """Follow the surface of another field, to the last bit as `of` would.

        Parameters
        ----------
        field : Field
        where : callable
            ``where(places) -> mask`` of the places (n, 3) at which the fields may differ; elsewhere they say the same.
        within : callable, optional
            In place of what was allowed, which it allows too.
        """
        self.allowed = self.allowed if within is None else _as_test(within, self.seeds)
        self.band.change(field, where, passed=not self.trusting)
        self._follow()

    def draw(self, *, sharpen: bool, features: bool, exact: Field | None = None) -> tuple[FloatArray, IntArray]:
        """Return vertices and triangles, see `draw_band` and `draw_dual`, which always sharpens."""
        ends = self.allowed is not None
        if isinstance(self.band, OctreeBand):
            return draw_dual(self.band, ends=ends, features=features, exact=exact)
        return draw_band(self.band, sharpen=sharpen, ends=ends, features=features, exact=exact)

    def _follow(self) -> None:
        """Visit the cells that seeds lead to."""
        band, seeding, growing = self.band, *progress.split(*SHARES[:2])
        with seeding:
            moved = _toward_zero(band.field, self.seeds, band.level, TOLERANCE * float(band.step.min()))
            cells = band.retrace(band.cells_of(moved if band.box is None else np.clip(moved, *band.box)))
            if not self.trusting:
                cells = band.only(cells, self.allowed)
        with growing:
            while len(cells):
                cells = band.only(band.advance(cells), self.allowed)
        if band.is_empty:
            raise ReconstructionError(
                f"seeds: none of {len(self.seeds)} leads to a cell that the surface {band.level:g} crosses; give "
                "points near it, or a finer spacing"
            )


def _as_test(within: Within | None, seeds: FloatArray) -> Callable[[FloatArray], BoolArray] | None:
    """Return `within` as a function of (n, 3) points."""
    if within is None:
        return None
    if callable(within):
        test = within
        return lambda centers: as_mask(test(centers), (len(centers),), "within")
    reach, tree = require_positive(within, "within"), cKDTree(seeds)
    return lambda centers: np.isfinite(query(tree, centers, distance_upper_bound=reach)[0])


def _thin(seeds: FloatArray, step: FloatArray) -> FloatArray:
    """Return the first seed of each block of cells."""
    block = np.floor(seeds / (SEED_BLOCK * step))
    block -= block.min(axis=0)
    width = block.max(axis=0) + 1
    if np.prod(width) < 2.0**62:
        whole = width.astype(np.int64)
        place = (block[:, 0].astype(np.int64) * whole[1] + block[:, 1].astype(np.int64)) * whole[2]
        first = np.unique(place + block[:, 2].astype(np.int64), return_index=True)[1]
    else:
        first = np.unique(block, axis=0, return_index=True)[1]
    return np.asarray(seeds[np.sort(first)])


def _toward_zero(field: Field, points: FloatArray, level: float, tolerance: float) -> FloatArray:
    """Return points moved towards F = level, no step longer than the bounds, until the last is below a tolerance."""

    def jet(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, gradients = values_and_gradients(field, points)
        return values - level, gradients

    diagonal = float(np.linalg.norm(np.diff(field.bounds, axis=0)))
    moved, _ = project_to_level(points, jet, max_step=diagonal, tolerance=tolerance, max_iterations=MAX_ITERATIONS)
    return require_finite(moved, "seeds moved onto the surface")
