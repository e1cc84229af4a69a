"""The surface of a chart: S from the plane (u, v) to space, a partition of unity of polyharmonic splines."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, NotNegative, Order, Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_weights
from o3dleaf.core.checks.coordinates import as_bounds, as_points, as_sites, require_near
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import check_unit
from o3dleaf.fitting.cover.cover import Cover, as_ball_size
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.columns.column_splines import fit_columns
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL, ScatteredData
from o3dleaf.fitting.pu.interpolant import OVERLAP
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from o3dleaf.leaf.parametric import lift_loops
from o3dleaf.leaf.parametric.feet import SAMPLE_COUNT, closest_feet, feet_from, jets_of, sample_surface
from o3dleaf.leaf.parametric.feet_loops import Samples
from o3dleaf.leaf.parametric.spline_loops import VectorBalls
from o3dleaf.leaf.parametric.splines import CUBIC, VectorSplines

REACH = 4.0
"""Distance from the sites, in their mean spacings, to which feet are looked for where no outline is given."""


@dataclass(frozen=True, eq=False)
class ChartSurface:
    r"""A smooth surface x = S(u, v), each coordinate blended from splines r³ with linear tails over one cover of balls.

    Outside its bounds S goes on linearly along each axis from the nearest point of the box, with continuous first
    derivatives; second derivatives there leave out third ones of S.

    Attributes
    ----------
    cover : Cover
        Of the plane.
    index : BallIndex
    local : VectorSplines
    unit : str or None
        Unit of length of the plane and of space.
    """

    cover: Cover
    index: BallIndex
    local: VectorSplines
    unit: str | None = None

    @classmethod
    @checked
    def fit(
        cls,
        parameters: npt.ArrayLike,
        points: npt.ArrayLike,
        *,
        smoothing: NotNegative,
        weights: npt.ArrayLike | None = None,
        unit: Unit | None = None,
        bounds: npt.ArrayLike | None = None,
        points_per_ball: Count | tuple[Count, Count] = POINTS_PER_BALL,
    ) -> "ChartSurface":
        """Fit S to points at given parameters, by least squares and the energy of the kernel.

        Parameters
        ----------
        parameters : (n, 2) array_like
            (u, v), in `unit`.
        points : (n, 3) array_like
        smoothing : float
            The number on the diagonal, as in `PUInterpolant.fit`.
        weights : (n,) array_like, optional
            Above 0: the smoothing at a point is divided by its weight.
        unit : str, optional
        bounds : (2, 2) array_like, optional
            The box of the plane to cover, if larger than that of the parameters.
        points_per_ball : int or (least, most)

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite.
        """
        sites = as_sites(parameters, "parameters", dim=2, least=3)
        space = as_sites(points, "points", dim=3)
        if len(space) != len(sites):
            raise InputError(f"points: are {len(space)}, parameters {len(sites)}; give one for each")
        tight = np.array([sites.min(axis=0), sites.max(axis=0)])
        box = tight if bounds is None else as_bounds(bounds, 2, "bounds")
        if np.any(box[0] > tight[0]) or np.any(box[1] < tight[1]):
            raise InputError("bounds: do not contain all parameters; enlarge them")
        trust = None if weights is None else as_weights(weights, len(sites))
        cover, index = Cover.indexed(sites, box, as_ball_size(points_per_ball, OVERLAP), OVERLAP)
        model = SplineModel(CUBIC, 1, Smoothing(smoothing))
        columns = fit_columns(cover, ScatteredData(sites, space, trust), model)
        return cls(cover, index, VectorSplines.of(columns), check_unit(unit))

    def __repr__(self) -> str:
        along, across = np.ptp(self.bounds, axis=0)
        unit = f" {self.unit}" if self.unit else ""
        return f"ChartSurface({along:.4g} × {across:.4g}{unit}, {len(self.cover.radii):,} balls)"

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) box of the plane that is covered."""
        return self.cover.bounds

    @property
    def length(self) -> float:
        """Diagonal of the box: the length that all others are measured by."""
        return float(np.linalg.norm(np.ptp(self.bounds, axis=0)))

    @cached_property
    def balls(self) -> VectorBalls:
        """What the compiled loops read."""
        return self.local.balls(self.index)

    @cached_property
    def sites(self) -> FloatArray:
        """(total, 2) the parameters that the balls were fitted to; one in several balls is there several times."""
        offsets, blocks = self.local.offsets, []
        for ball, (first, last) in enumerate(pairwise(offsets)):
            unit = self.local.sites[2 * first : 2 * last].reshape(2, -1).T
            blocks.append(self.cover.centers[ball] + self.cover.radii[ball] * unit)
        return np.concatenate(blocks)

    def _near(self, uv: npt.ArrayLike, name: str) -> FloatArray:
        return require_near(as_points(uv, name, dim=2), self.bounds, name)

    @checked
    def jet(self, uv: npt.ArrayLike, order: Order = 2) -> tuple[FloatArray, ...]:
        """Return S (n, 3), its first derivatives (n, 2, 3) by u and v, and its second ones (n, 3, 3), uu, uv and vv.

        Parameters
        ----------
        uv : (n, 2) array_like
        order : {0, 1, 2}
            The highest of the derivatives.
        """
        jets = jets_of(self.balls, self._near(uv, "uv"), order)
        return tuple(part for part in (jets[:, 0], jets[:, 1:3], jets[:, 3:6])[: order + 1])

    def normals(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the unit normals S_u × S_v / |S_u × S_v|, (n, 3)."""
        first, second = np.moveaxis(self.jet(uv, 1)[1], 1, 0)
        normal = np.cross(first, second)
        return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, np.newaxis])

    def metric(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the first fundamental form (n, 2, 2): the unit matrix where the chart keeps lengths and angles."""
        tangents = self.jet(uv, 1)[1]
        return np.asarray(np.einsum("nak,nbk->nab", tangents, tangents))

    def curvatures(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the principal curvatures (n, 2), positive where S bends towards its normal, least first."""
        jets = jets_of(self.balls, self._near(uv, "uv"), 2)
        found = np.empty((len(jets), 2))
        lift_loops.curvatures(jets, found)
        return found

    @property
    def sample_step(self) -> float:
        """Distance in the plane of samples from which feet are found, all over the bounds."""
        return float(np.sqrt(np.ptp(self.bounds, axis=0).prod() / SAMPLE_COUNT))

    @cached_property
    def _near_sites(self) -> Samples:
        """Samples within `REACH` of the sites."""
        points = max(int(self.cover.members.max()) + 1, 1)
        reach = REACH * float(np.sqrt(np.ptp(self.bounds, axis=0).prod() / points)) + self.sample_step
        tree = cKDTree(self.sites)

        def near(places: FloatArray) -> npt.NDArray[np.bool_]:
            return np.asarray(tree.query(places, distance_upper_bound=reach)[0] < np.inf)

        return sample_surface(self.balls, self.bounds, self.sample_step, near)

    @checked
    def feet(
        self, x: npt.ArrayLike, start: npt.ArrayLike | None = None, *, samples: Samples | None = None
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Return the closest points of the surface: (u, v) (n, 2), heights along the normal (n,), and which were found.

        Parameters
        ----------
        x : (n, 3) array_like
        start : (n, 2) array_like, optional
            Where to begin, and where a point stays whose foot is not found; without it each foot is the closest of
            all, as long as x lies nearer than a focus.
        samples : Samples, optional
            Where to look for them; near the surface's sites by default.
        """
        points = as_points(x, "x", dim=3)
        begin = None if start is None else self._near(start, "start")
        if begin is not None and len(begin) != len(points):
            raise InputError(f"start: has {len(begin):,} places for {len(points):,} points; give one for each")
        if begin is None:
            found = closest_feet(self.balls, points, self._near_sites if samples is None else samples)
        else:
            found = feet_from(self.balls, points, begin, self.sample_step)
        lost = np.flatnonzero(~np.isfinite(found.plane).all(axis=1))
        if len(lost) and begin is None:
            raise InputError(f"x: {len(lost):,} lie too far away to tell their feet; give places near the surface")
        if len(lost) and begin is not None:
            # Where the surface is folded over, steps lead out of all bounds: such points stay where they began.
            stay = begin[lost]
            away = points[lost] - self.jet(stay, 0)[0]
            found.plane[lost], found.converged[lost] = stay, False
            found.heights[lost] = np.einsum("ij,ij->i", away, self.normals(stay))
        return found.plane, found.heights, found.converged
