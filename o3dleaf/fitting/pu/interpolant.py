"""The partition-of-unity interpolant: F(x) = Σ w_i(x) F_i(x), the paper's section 2.3."""

import hashlib
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Finite, PartialShare, Positive, SmoothingValue, Unit
from o3dleaf.core.checks.arrays import FloatArray, as_array
from o3dleaf.core.checks.attributes import require_one_column, warn_of_contradictions
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import as_number
from o3dleaf.core.checks.voxels import as_mask, as_voxels
from o3dleaf.core.errors import InputError
from o3dleaf.core.lattice import Lattice
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.units import check_unit
from o3dleaf.fitting.cover.contrast import widen_clusters
from o3dleaf.fitting.cover.cover import Cover, as_ball_size
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.cover.voxel_lattice import VoxelLattice
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.local.fields import FitBall
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL, Fitter, LocalFits, RefittableFits, ScatteredData
from o3dleaf.fitting.local.fitter_selection import as_fitter
from o3dleaf.fitting.local.splines import LocalSplines, Splines
from o3dleaf.fitting.local.voxels.lattice_balls import cover_in_full, cover_near_surface
from o3dleaf.fitting.local.voxels.lattice_fit import fit_voxels, require_room_for_voxels
from o3dleaf.fitting.pu.blend import Blended
from o3dleaf.fitting.pu.diagnostics import BallDiagnostics, diagnose_balls
from o3dleaf.fitting.pu.lattice_blend import blend_on_lattice
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.io.models.model_file import write_model

OVERLAP = 1.1
SHARES = (1, 3)
"""About how long covering the points and fitting the balls take."""


@dataclass(frozen=True, eq=False)
class PUInterpolant(Blended):
    r"""A function blended from local fits in overlapping balls, with Wendland's weight and Shepard's sum.

    .. math:: F(x) = \sum_i w_i(x) F_i(x), \qquad
              w_i(x) = \frac{w(|x - c_i|/r_i)}{\sum_k w(|x - c_k|/r_k)}

    Built by `fit`, `fit_oriented` or `fit_lattice`. Every point of `bounds` lies in some ball; outside, the local
    fits go on, with the weights of the nearest point of `bounds`, see `Blended`.

    Attributes
    ----------
    cover : Cover
    index : BallIndex
    local : LocalFits
        What lives in the balls, such as `LocalSplines`.
    unit : str or None
    data_hash : str
        SHA-256 of the points, values and weights, or of the points and normals, that it was fitted to.
    """

    cover: Cover
    index: BallIndex
    local: LocalFits
    unit: str | None
    data_hash: str = ""

    def __repr__(self) -> str:
        members, balls = self.cover.members, f"{len(self.cover.radii):,} balls"
        count = f"{members.max() + 1:,} points in {balls}" if len(members) else balls
        count += f", {self.columns} columns" if self.columns else ""
        unit = f", unit {self.unit}" if self.unit else ""
        return f"PUInterpolant({self.bounds.shape[1]}-D, {count}{unit})"

    @classmethod
    @checked
    def fit(  # noqa: PLR0913 - the options of a spline, of a cover and of a field
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        kernel: str | Polyharmonic = "cubic",
        degree: int | None = None,
        smoothing: SmoothingValue | None = None,
        rho: SmoothingValue | None = None,
        points_per_ball: Count | tuple[Count, Count] | None = None,
        overlap: float = OVERLAP,
        weights: npt.ArrayLike | None = None,
        groups: npt.ArrayLike | None = None,
        share: PartialShare = 0.0,
        normals: npt.ArrayLike | None = None,
        local: Fitter | FitBall | None = None,
        unit: Unit | None = None,
        bounds: npt.ArrayLike | None = None,
    ) -> "PUInterpolant":
        r"""Cover the data with balls and fit each of them.

        Parameters
        ----------
        points : (n, d) array_like
            Data sites, in `unit`.
        values : (n,) or (n, c) array_like
            One number a point, or c of them: colors, scalars. All columns are fitted by one factorization a ball, and
            the field then returns (m, c), its gradient (m, c, d). "gcv" chooses one smoothing for all of them, from
            their errors together: bring columns of different units to one scale, or fit them apart.
        kernel, degree
            As in `RBFInterpolant.fit`: by default r³ with the tail of its energy's null space
            (degree 2 in 3-D).
        smoothing : float, "gcv" or "gcv-per-ball", optional
            The number on the diagonal of every ball, as in SciPy; 0 by default. "gcv" takes what a fixed
            sample of balls agrees on, "gcv-per-ball" what each ball chooses for itself, at about ten times
            the cost of the fit; see `o3dleaf.fitting.rbf.smoothing.choose_by_gcv`. The surface then does
            not depend on the size of the balls as long as the smoothing's own bandwidth, about
            (θ·smoothing/density)^(1/2m), stays well below their radius; give larger balls if it does not.
        rho : float, "gcv" or "gcv-per-ball", optional
            The paper's ρ instead, in unit^(2m−d): N_i ρ/θ on the diagonal of ball i with N_i points.
        points_per_ball : int or (least, most), optional
            Balls contain at most `most` points; one that contains fewer than `least` is fitted to its
            `least` nearest, and one that has hardly more than a cluster of many times the density of what is around
            to points around it as well. An int n stands for (n/2, n). By default what suits the local fit, (200, 400)
            for splines.
        overlap : float
            Radius of a ball over half the diagonal of its cell, above 1.
        weights : (n,) array_like, optional
            Above 0: point j gets its ball's number divided by its
            weight on the diagonal. They matter only where something is smoothed.
        groups : (n,) array_like of int, optional
            The group of each point: the row of the measured point that it was made from, its own for measured points.
            The points of a group share their error, which "gcv" would take for the surface's shape: given the groups,
            it leaves each of them out as a whole, and takes the least mean square error there.
            "gcv-per-ball" then costs no more than the fit, and chooses around what "gcv" takes.
        share : float
            The part of the variance of their errors that the points of a group have in common, from 0 to below 1. What
            is smoothed then is a group's mean more than its differences; and the errors by which "gcv" judges are
            those of the measured points, over the slope that the fit leaves of the differences. What
            a fit leaves of their values on average is taken off its ball, as far as it is not chance.
        normals : (n, d) array_like, optional
            Outward normals, of any length above 0, where the values are those of a surface; for fits that use them.
        local : optional
            Any other fit: an object with ``fit(cover, data) -> LocalFits`` and `points_per_ball`, such as
            `CreasedSplines` or `Hermite`, or a callable ``local(points, values) -> Field`` that fits one ball, such as
            `RBFInterpolant.fit` with a kernel that has a shape. The options of the spline (kernel to rho) then have no
            meaning, and there may be one column of values.
        unit : str, optional
        bounds : (2, d) array_like, optional
            The box to cover, if larger than the data's bounding box.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, or an option makes no sense.
        IllPosedError
            If the degree is below what the kernel needs. Data that cannot determine the tail are no
            error: its terms that vanish on the ball's points are left out.

        Warns
        -----
        DataWarning
            If points coincide with different values where nothing is smoothed: the fit goes through their means.
        """
        data = ScatteredData.of(points, values, weights=weights, groups=groups, normals=normals, share=share)
        if local is not None and data.values.ndim > 1:
            raise InputError("values: several columns are for splines; leave out local, or fit one column")
        fitter = Splines(kernel, degree, smoothing, rho) if local is None else as_fitter(local, data)
        data_hash = _hash(data.points, data.values, data.weights)
        fitted = cls._fitted(data, fitter, points_per_ball, overlap, bounds, unit, data_hash)
        if isinstance(fitted.local, LocalSplines | LocalColumns) and fitted.local.dropped.any():
            warn_of_contradictions(data.points, data.values)
        return fitted

    @classmethod
    @checked
    def fit_oriented(
        cls,
        points: npt.ArrayLike,
        normals: npt.ArrayLike,
        *,
        local: str | Fitter = "auto",
        points_per_ball: Count | tuple[Count, Count] | None = None,
        overlap: float = OVERLAP,
        unit: Unit | None = None,
        bounds: npt.ArrayLike | None = None,
    ) -> "PUInterpolant":
        r"""Fit points on a surface and the outward normals there, without points beside it: F = 0, ∇F = −n.

        Near the surface F is a signed distance to first order, larger inside. Cover and blend are those of `fit`.

        Parameters
        ----------
        points : (n, d) array_like
            Points of the surface, in `unit`; of a plane curve where d is 2.
        normals : (n, d) array_like
            Outward normals, of any length above 0.
        local : {"auto", "hermite", "curl-free", "mls"} or object with a fit
            What is fitted in a ball: `Hermite`, `CurlFree`, `MovingLeastSquares` or your own, see `fit`.
            "auto" takes polynomials in large balls where noise hides the shape from small ones, else `Hermite` with
            smoothing by GCV; see `o3dleaf.fitting.local.fitter_selection.choose_fitter`.
        points_per_ball : int or (least, most), optional
            As in `fit`; by default what suits the local fit.
        overlap, unit, bounds
            As in `fit`.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, a normal is zero, or an option makes no sense.
        """
        data = ScatteredData.on_surface(points, normals)
        fitter, data_hash = as_fitter(local, data), _hash(data.points, data.normals)
        return cls._fitted(data, fitter, points_per_ball, overlap, bounds, unit, data_hash)

    @classmethod
    def _fitted(  # noqa: PLR0917 - all that a fit of scattered data consists of
        cls,
        data: ScatteredData,
        fitter: Fitter,
        points_per_ball: int | tuple[int, int] | None,
        overlap: float,
        bounds: npt.ArrayLike | None,
        unit: str | None,
        data_hash: str,
    ) -> "PUInterpolant":
        """Cover the data and fit the balls."""
        count = len(data.points)
        require_resources(measured.FITTED_POINT * count, f"fit: {count:,} points", "give fewer, or smaller balls")
        box = _box(data.points, bounds)
        size = as_ball_size(fitter.points_per_ball if points_per_ball is None else points_per_ball, overlap)
        covering, fitting = progress.split(*SHARES)
        with covering:
            cover, index = Cover.indexed(data.points, box, size, overlap)
            if isinstance(fitter, Splines):  # others take what lies beyond a ball for as near as the rest
                cover = widen_clusters(cover, data.points, size[0])
        with fitting:
            local = fitter.fit(cover, data)
        return cls(cover, index, local, check_unit(unit), data_hash)

    @classmethod
    @checked
    def fit_lattice(  # noqa: PLR0913 - the options of a lattice besides those of a spline, of a cover and of a field
        cls,
        values: npt.ArrayLike,
        *,
        spacing: Positive | npt.ArrayLike,
        origin: npt.ArrayLike | None = None,
        transform: npt.ArrayLike | None = None,
        isovalue: Finite = 0.0,
        mask: npt.ArrayLike | None = None,
        band: bool = False,
        kernel: str | Polyharmonic = "cubic",
        degree: int | None = None,
        smoothing: SmoothingValue | None = None,
        rho: SmoothingValue | None = None,
        points_per_ball: Count | tuple[Count, Count] = POINTS_PER_BALL,
        overlap: float = OVERLAP,
        unit: Unit | None = None,
        bounds: npt.ArrayLike | None = None,
    ) -> "PUInterpolant":
        r"""Fit the voxels of a volume, by balls that sit alike on its lattice and share one factorization.

        As exact as `fit` to the same voxels with the same balls, and about ten times as fast: the cost is that
        of reading each ball's values. The balls lie as the lattice does, not as the box of the data.

        Parameters
        ----------
        values : (n_1, ..., n_d) array_like
            Real numbers of any type; ``values[i, j, k]`` lies at origin + spacing * (i, j, k).
        spacing : float or (d,) array_like
            Distance between voxels, in `unit`.
        origin : (d,) array_like, optional
            Position of the first voxel, in `unit`; 0 by default.
        transform : (d + 1, d + 1) array_like, optional
            Rigid motion of the lattice, for example from `align_blade`; give `bounds` with it.
        isovalue : float
            Taken off the values, so that the surface is where the field is zero.
        mask : array_like of bool, of the shape of `values`, optional
            Where the full resolution is wanted, such as a band around the surface. It chooses balls: where they
            contain no marked voxel, larger ones are fitted to every second, fourth, ... voxel.
        band : bool
            Whether balls away from the isovalue, whose voxels and those around all lie on one side of it, are larger
            ones with a plane of least squares in each: `o3dleaf.fitting.cover.lattice_band` says which. Where none of
            these reaches, as around the surface, the field has the values that it has without a band, to rounding; it
            is nowhere zero else. Memory and time go with the surface, not with the volume. Not beside a `mask`.
        kernel, degree, smoothing, rho, overlap, unit
            As in `fit`; "gcv" looks at the balls in the interior.
        points_per_ball : int or (least, most)
            Balls contain at most so many voxels; those at a face of the lattice fewer.
        bounds : (2, d) array_like, optional
            The box to cover, within the voxels' faces; by default that of the voxels' centers. Voxels outside
            the box are used where a ball reaches them.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, or the box is not within the voxels.
        IllPosedError
            If the degree is below what the kernel needs.
        """
        if band and mask is not None:
            raise InputError("mask, band: both would choose the balls; give one of them")
        count = as_array(values, "values").size
        if not band:
            require_room_for_voxels(count, None)
        data = as_voxels(values)
        voxels = VoxelValues.of_array(data, as_number(isovalue, "isovalue"))
        lattice = VoxelLattice.of(data.shape, spacing, origin, transform)
        box, marked = lattice.box(bounds), None if mask is None else as_mask(mask, data.shape)
        _, most = as_ball_size(points_per_ball, overlap)
        volume = voxels, lattice, most, overlap, box, Splines(kernel, degree, smoothing, rho).model(data.ndim)
        if band:
            cover, model = cover_near_surface(*volume)
            require_room_for_voxels(count, cover)
        else:
            cover, model = cover_in_full(*volume, mask=marked)
        splines = fit_voxels(cover, voxels, model)
        centers, radii = cover.centers(lattice.origin), cover.radii
        balls = Cover(centers, radii, box, splines.offsets, np.empty(0, dtype=np.int64))
        data_hash = _hash(data, lattice.spacing, lattice.start, lattice.turn, lattice.origin)
        release_pages(data)
        return cls(balls, BallIndex.build(centers, radii, box), splines, check_unit(unit), data_hash)

    def with_points(self, data: ScatteredData, count: int) -> "PUInterpolant":
        """Return the interpolant of more data: those balls are fitted again that contain a new point.

        They keep their smoothing, unless each chose its own, and those with creases lose them. Only `RefittableFits` of
        scattered data can do it: splines of values, `Hermite`, `CurlFree` and `MovingLeastSquares`.

        Parameters
        ----------
        data : ScatteredData
            The data that it was fitted to, and the new ones behind them; to points and normals, new points without
            a normal are values, with a normal of 0.
        count : int
            How many of them are new.

        Raises
        ------
        InputError
            If the local fits cannot be made again one by one.
        """
        if not isinstance(self.local, RefittableFits):
            raise InputError("local: these fits take no more points; fit splines of values, with local=None")
        old = len(data.points) - count
        offsets, rows = self.index.members(data.points[old:])
        ball = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
        cover = self.cover.with_members(ball, rows + old)
        local = self.local.with_points(cover, data, np.unique(ball))
        return replace(self, cover=cover, local=local, data_hash=_hash(data.points, data.values, data.weights))

    @property
    def bounds(self) -> FloatArray:
        """(2, d) the covered box, in `unit`."""
        return self.cover.bounds

    @property
    def rough_error(self) -> float:
        """The most that `rough` is off within the bounds: infinite where the local fits are no splines."""
        return self.local.single_error if isinstance(self.local, LocalSplines) else np.inf

    def rough(self, points: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return the (n,) values at (n, d) points from sums in single precision, in little more than half the time."""
        return self(points, dtype=np.float32)

    def rough_on(self, lattice: Lattice) -> npt.NDArray[np.float32] | None:
        """Return the rough values on a lattice on which the balls of a fit to voxels sit alike, or None.

        So they do on lattices of the voxels' step, and of parts of it; it takes a quarter of the time.
        """
        return blend_on_lattice(self.local, self.index, lattice) if isinstance(self.local, LocalSplines) else None

    def diagnostics(self, balls: npt.ArrayLike | None = None) -> BallDiagnostics:
        """Return smoothing, score, degrees of freedom, condition and leave-one-out error of the fit of each ball.

        It costs an eigen-decomposition for each ball, about ten times its fit, and needs no data: a
        model that was loaded has them as well.

        Parameters
        ----------
        balls : (M,) array_like of int, optional
            Numbers of the balls; all by default, but for bare ones, see `fit_lattice`, which have no fit of their own.

        Raises
        ------
        InputError
            If the local fits are no splines, or there is no ball of such a number, or it is bare.
        """
        require_one_column(self, "diagnostics")
        if not isinstance(self.local, LocalSplines):
            raise InputError("diagnostics: the local fits are no splines; fit values, with local=None")
        return diagnose_balls(self.cover, self.local, balls)

    @checked
    def save(self, path: str | PathLike[str]) -> None:
        """Write the interpolant as one model file, which `o3dleaf.load` reads."""
        write_model(self, path)


def _box(sites: FloatArray, bounds: npt.ArrayLike | None) -> FloatArray:
    """Return the box to cover, or raise `InputError` where points lie outside."""
    tight = np.array([sites.min(axis=0), sites.max(axis=0)])
    if bounds is None:
        return tight
    box = as_bounds(bounds, sites.shape[1])
    if np.any(tight[0] < box[0]) or np.any(tight[1] > box[1]):
        raise InputError("bounds: do not contain all the points; enlarge them or crop the points first")
    return box


def _hash(*arrays: npt.NDArray[Any] | None) -> str:
    """Return the SHA-256 of the bytes of the arrays that there are."""
    digest = hashlib.sha256()
    for array in arrays:
        if array is not None:
            # A part at a time: what lies otherwise is copied.
            for part in [array] if array.flags.c_contiguous else array:
                digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()
