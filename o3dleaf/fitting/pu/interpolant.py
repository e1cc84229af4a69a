"""The partition-of-unity interpolant: F(x) = Σ w_i(x) F_i(x), the paper's section 2.3."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from os import PathLike
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import (
    FloatArray,
    as_bounds,
    as_mask,
    as_normals,
    as_number,
    as_points,
    as_rigid_motion,
    as_rows,
    as_step,
    as_values,
    as_voxels,
    as_weights,
)
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.parallel import Progress, share_out
from o3dleaf.core.units import check_unit
from o3dleaf.fitting.creases.creases import fit_creased
from o3dleaf.fitting.creases.sheets import ANGLE, Surface
from o3dleaf.fitting.pu.blend import Blended
from o3dleaf.fitting.pu.cover import Cover, as_ball_size
from o3dleaf.fitting.pu.diagnostics import Appraisal, appraise_balls
from o3dleaf.fitting.pu.fitter_selection import as_fitter
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.pu.lattice_fit import VoxelCover, VoxelValues, fit_splines
from o3dleaf.fitting.pu.local import LocalFields, LocalFits, LocalSplines
from o3dleaf.fitting.pu.oriented import OrientedFitter
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_degree, as_kernel
from o3dleaf.fitting.rbf.smoothing import Amount, as_smoothing
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.io.model_file import write_model

POINTS_PER_BALL = (200, 400)
OVERLAP = 1.1
SHARES = (1, 3)
"""About how long covering the points and fitting the balls take."""

FACE = 1e-6
"""Share of a voxel that a box may reach beyond the lattice: the rounding of a box computed from it."""

LocalFitter = Callable[[FloatArray, FloatArray], Field]
"""Fits one ball: (n, d) points and (n,) values in, a Field out."""


@dataclass(frozen=True, eq=False)
class PUInterpolant(Blended):
    r"""A function blended from local fits in overlapping balls, with Wendland's weight and Shepard's sum.

    .. math:: F(x) = \sum_i w_i(x) F_i(x), \qquad
              w_i(x) = \frac{w(|x - c_i|/r_i)}{\sum_k w(|x - c_k|/r_k)}

    Built by `fit`. Every point of `bounds` lies in some ball; outside, the value is the one at the
    nearest point of `bounds` less the distance to it.

    Attributes
    ----------
    cover : Cover
    index : BallIndex
    local : LocalSplines, LocalPotentials, LocalPolynomials or LocalFields
    unit : str or None
    data_hash : str
        SHA-256 of the points, values and weights that it was fitted to.
    """

    cover: Cover
    index: BallIndex
    local: LocalFits
    unit: str | None
    data_hash: str = ""

    @classmethod
    def fit(  # noqa: PLR0913 - the options of a spline, of a cover and of a field
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        kernel: str | Polyharmonic = "cubic",
        degree: int | None = None,
        smoothing: Amount | None = None,
        rho: Amount | None = None,
        points_per_ball: int | tuple[int, int] = POINTS_PER_BALL,
        overlap: float = OVERLAP,
        weights: npt.ArrayLike | None = None,
        owners: npt.ArrayLike | None = None,
        normals: npt.ArrayLike | None = None,
        creases: Literal["auto", False] | float = False,
        unit: str | None = None,
        bounds: npt.ArrayLike | None = None,
        local: LocalFitter | None = None,
        progress: Progress | None = None,
    ) -> "PUInterpolant":
        r"""Cover the data with balls and fit each of them.

        Parameters
        ----------
        points : (n, d) array_like
            Data sites, in `unit`.
        values : (n,) array_like
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
        points_per_ball : int or (least, most)
            Balls hold at most `most` points; one that holds fewer than `least` is fitted to its
            `least` nearest. An int n stands for (n/2, n).
        overlap : float
            Radius of a ball over half the diagonal of its cell, above 1.
        weights : (n,) array_like, optional
            How far each value is to be trusted, above 0: point j gets its ball's number divided by its
            weight on the diagonal. They matter only where something is smoothed.
        owners : (n,) array_like of int, optional
            The row that each constraint was made from, its own for measured points. Constraints made from
            one point share its error, which "gcv" would take for the surface's shape: given the owners, it
            leaves each point out with all that was made from it, and takes the least mean square error there.
            "gcv-per-ball" then costs no more than the fit, and chooses around what "gcv" takes.
        normals : (n, 3) array_like, optional
            Outward unit normals of the measured points, which creases are found from; other rows are not read.
        creases : "auto", False or float
            Balls whose measured points fall into smooth sheets get a spline for each sheet, combined by minima
            and maxima (`o3dleaf.fitting.creases.creases`), where that foretells points left out better than one spline.
            Normals turn by so many degrees, at least, across a crease; "auto" is 30.
        unit : str, optional
        bounds : (2, d) array_like, optional
            The box to cover, if larger than the data's bounding box.
        local : callable, optional
            ``local(points, values) -> Field`` fits a ball by any other method; the options of the
            spline (kernel to rho) then have no meaning.
        progress : callable, optional
            ``progress(done, total)``, in shares of the work.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, or an option makes no sense.
        IllPosedError
            If the degree is below what the kernel needs. Data that cannot determine the tail are no
            error: its terms that vanish on the ball's points are left out.
        """
        sites = as_points(points, least=1)
        data = as_values(values, len(sites))
        box = _box(sites, bounds)
        size = as_ball_size(points_per_ball, overlap)
        covering, fitting = share_out(progress, *SHARES)
        cover, index = Cover.indexed(sites, box, size, overlap, covering)
        trust = None if weights is None else as_weights(weights, len(sites))
        made_from = None if owners is None else as_rows(owners, len(sites))
        data_hash = _hash(sites, data, trust)
        if local is not None:
            rows = np.split(cover.members, cover.offsets[1:-1])
            fields = []
            for number, r in enumerate(rows):
                fields.append(local(sites[r], data[r]))
                if fitting:
                    fitting(number + 1, len(rows))
            return cls(cover, index, LocalFields(fields), check_unit(unit), data_hash)
        phi, degree = _spline(kernel, degree, sites.shape[1])
        rule = as_smoothing(phi, smoothing, rho)
        if creases is not False:
            surface, made_from = _surface(sites, normals, made_from, creases)
            split = fit_creased(
                cover,
                sites,
                data,
                surface,
                kernel=phi,
                degree=degree,
                smoothing=rule,
                trust=trust,
                owners=made_from,
                progress=fitting,
            )
            return cls(cover, index, split, check_unit(unit), data_hash)
        splines = LocalSplines.fit(
            cover, sites, data, phi, degree, rule, trust=trust, owners=made_from, progress=fitting
        )
        return cls(cover, index, splines, check_unit(unit), data_hash)

    @classmethod
    def fit_oriented(
        cls,
        points: npt.ArrayLike,
        normals: npt.ArrayLike,
        *,
        local: str | OrientedFitter = "auto",
        points_per_ball: int | tuple[int, int] | None = None,
        overlap: float = OVERLAP,
        unit: str | None = None,
        bounds: npt.ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> "PUInterpolant":
        r"""Fit points on a surface and the outward normals there, without points beside it: F = 0, ∇F = −n.

        Near the surface F is a signed distance to first order, larger inside. Cover and blend are those of `fit`.

        Parameters
        ----------
        points : (n, d) array_like
            Points of the surface, in `unit`; of a plane curve where d is 2.
        normals : (n, d) array_like
            Outward normals, of any length above 0.
        local : {"auto", "hermite", "curl-free", "mls"} or OrientedFitter
            What is fitted in a ball; see `fitting.pu.oriented` for the objects behind the names and their options.
            "auto" takes polynomials in large balls where noise hides the shape from small ones, else `Hermite` with
            smoothing by GCV; see `o3dleaf.fitting.pu.fitter_selection.choose_fitter`.
        points_per_ball : int or (least, most), optional
            As in `fit`; by default what suits the local fit.
        overlap, unit, bounds, progress
            As in `fit`.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, a normal is zero, or an option makes no sense.
        """
        sites = as_points(points, least=1)
        outward = as_normals(normals, sites)
        fitter = as_fitter(local, sites, outward)
        box = _box(sites, bounds)
        size = as_ball_size(fitter.points_per_ball if points_per_ball is None else points_per_ball, overlap)
        covering, fitting = share_out(progress, *SHARES)
        cover, index = Cover.indexed(sites, box, size, overlap, covering)
        fits = fitter.fit(cover, sites, outward, progress=fitting)
        return cls(cover, index, fits, check_unit(unit), _hash(sites, outward))

    @classmethod
    def fit_lattice(  # noqa: PLR0913 - the options of a lattice besides those of a spline, of a cover and of a field
        cls,
        values: npt.ArrayLike,
        *,
        spacing: float | npt.ArrayLike,
        origin: npt.ArrayLike | None = None,
        transform: npt.ArrayLike | None = None,
        isovalue: float = 0.0,
        mask: npt.ArrayLike | None = None,
        kernel: str | Polyharmonic = "cubic",
        degree: int | None = None,
        smoothing: Amount | None = None,
        rho: Amount | None = None,
        points_per_ball: int | tuple[int, int] = POINTS_PER_BALL,
        overlap: float = OVERLAP,
        unit: str | None = None,
        bounds: npt.ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> "PUInterpolant":
        r"""Fit the voxels of a volume, by balls that sit alike on its lattice and share one factorisation.

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
            hold no marked voxel, larger ones are fitted to every second, fourth, ... voxel.
        kernel, degree, smoothing, rho, overlap, unit, progress
            As in `fit`; "gcv" looks at the balls in the interior.
        points_per_ball : int or (least, most)
            Balls hold at most so many voxels; those at a face of the lattice hold fewer.
        bounds : (2, d) array_like, optional
            The box to cover, within the voxels' faces; by default that of the voxels' centres. Voxels outside
            the box are used where a ball reaches them.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, or the box is not within the voxels.
        IllPosedError
            If the degree is below what the kernel needs.
        """
        data = np.ascontiguousarray(as_voxels(values))
        dimension = data.ndim
        step = as_step(spacing, dimension)
        start = np.zeros(dimension) if origin is None else as_points(origin, "origin", dim=dimension)[0]
        turn, moved = np.eye(dimension), start
        if transform is not None:
            turn, shift = as_rigid_motion(transform, dimension)
            moved = turn @ start + shift
        steps = step[:, np.newaxis] * turn.T
        box = _voxel_box(bounds, data.shape, steps, moved, turned=transform is not None)
        marked = None if mask is None else as_mask(mask, data.shape)
        _, most = as_ball_size(points_per_ball, overlap)
        cover = VoxelCover.fit(data.shape, steps, most, overlap, marked).reaching(box[0], box[1], moved)
        phi, degree = _spline(kernel, degree, dimension)
        rule = as_smoothing(phi, smoothing, rho)
        splines = fit_splines(cover, VoxelValues(data, as_number(isovalue, "isovalue")), phi, degree, rule, progress)
        centres, radii = cover.centres(moved), cover.radii
        balls = Cover(centres, radii, box, splines.offsets, np.empty(0, dtype=np.int64))
        data_hash = _hash(data, step, start, turn, moved)
        return cls(balls, BallIndex.build(centres, radii, box), splines, check_unit(unit), data_hash)

    @property
    def bounds(self) -> FloatArray:
        """(2, d) the covered box, in `unit`."""
        return self.cover.bounds

    def appraise(self, balls: npt.ArrayLike | None = None, *, progress: Progress | None = None) -> Appraisal:
        """Judge the fit of each ball: its smoothing, score, freedom, condition and leave-one-out error.

        It costs an eigen-decomposition for each ball, about ten times its fit, and needs no data: a
        model that was loaded can be judged as well.

        Parameters
        ----------
        balls : (M,) array_like of int, optional
            Numbers of the balls to judge; all by default.
        progress : callable, optional
            ``progress(done, total)`` over balls.

        Raises
        ------
        InputError
            If the balls hold other fits than splines, or there is no ball of such a number.
        """
        if not isinstance(self.local, LocalSplines):
            raise InputError("appraise: the balls do not hold splines; judge your own local fits yourself")
        count = len(self.cover.radii)
        asked = np.arange(count) if balls is None else np.atleast_1d(np.asarray(balls))
        if asked.dtype.kind not in "iu" or np.any((asked < 0) | (asked >= count)):
            raise InputError(f"balls: are {asked}; give whole numbers from 0 to {count - 1}")
        return appraise_balls(self.cover, self.local, asked.astype(np.int64), progress)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the interpolant as one model file, which `o3dleaf.load` reads."""
        write_model(path, self)


def _spline(kernel: str | Polyharmonic, degree: int | None, dimension: int) -> tuple[Polyharmonic, int]:
    """Return the kernel and the degree of its tail."""
    phi = as_kernel(kernel, dimension)
    return phi, as_degree(degree, phi)


def _surface(
    sites: FloatArray, normals: npt.ArrayLike | None, owners: IntArray | None, creases: Literal["auto"] | float
) -> tuple[Surface, IntArray]:
    """Return what creases are found from, and the owners, each row its own where none are given."""
    if normals is None or sites.shape[1] != 3:
        raise InputError("creases: are found from normals in three dimensions; give normals, or creases=False")
    angle = ANGLE if creases == "auto" else as_number(creases, "creases")
    if not 0 < angle < 180:
        raise InputError(f"creases: {angle:g} is no angle between 0 and 180 degrees; give 30, say, or False")
    made_from = np.arange(len(sites)) if owners is None else owners
    rows = np.flatnonzero(made_from == np.arange(len(sites)))
    facing = as_points(normals, "normals", dim=3)
    if len(facing) != len(sites):
        raise InputError(f"normals: {len(facing)} for {len(sites)} points; give one a point")
    return Surface(rows, as_normals(facing[rows], sites[rows]), angle), made_from


def _voxel_box(
    bounds: npt.ArrayLike | None, shape: tuple[int, ...], steps: FloatArray, origin: FloatArray, *, turned: bool
) -> FloatArray:
    """Return the box to cover, or raise `InputError` where it reaches beyond the voxels' faces."""
    if bounds is None:
        if turned:
            raise InputError("bounds: are needed with a transform; give a box within the turned voxels (inscribed_box)")
        return np.array([origin, origin + np.diag(steps) * (np.array(shape) - 1)])
    box = as_bounds(bounds, len(shape))
    corners = np.array(list(product(*box.T)))
    voxels = (corners - origin) @ np.linalg.inv(steps)
    if np.any(voxels < -0.5 - FACE) or np.any(voxels > np.array(shape) - 0.5 + FACE):
        raise InputError("bounds: reach beyond the voxels; give a smaller box (inscribed_box finds the largest)")
    return box


def _box(sites: FloatArray, bounds: npt.ArrayLike | None) -> FloatArray:
    tight = np.array([sites.min(axis=0), sites.max(axis=0)])
    if bounds is None:
        return tight
    box = as_bounds(bounds, sites.shape[1])
    if np.any(tight[0] < box[0]) or np.any(tight[1] > box[1]):
        raise InputError("bounds: do not hold all the points; enlarge them or crop the points first")
    return box


def _hash(*arrays: npt.NDArray[Any] | None) -> str:
    """Return the SHA-256 of the bytes of the arrays that there are."""
    digest = hashlib.sha256()
    for array in arrays:
        if array is not None:
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
