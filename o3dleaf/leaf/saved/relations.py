"""Relations between the arrays of a stored object, or its parts."""

from collections.abc import Callable
from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.local.fit_loops import SharedTrials
from o3dleaf.fitting.local.polynomials import LocalPolynomials
from o3dleaf.fitting.local.potentials import LocalPotentials
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.parametric.splines import VectorSplines
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.saved.array_kinds import Array, Sizes, everywhere, floats, never_falls
from o3dleaf.leaf.texture.hairs.zones import HairZones
from o3dleaf.leaf.texture.wang.quilt import Quilt
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

MAX_POWER = 99
"""Of a polyharmonic kernel; r^99 of single numbers overflows soon after."""

Local = LocalSplines | LocalColumns | LocalPolynomials | LocalPotentials | LocalCreasedSplines | VectorSplines


def _check_cover(cover: Cover) -> None:
    """Check the offsets; balls on a lattice have counts without members."""
    last = len(cover.members) or cover.offsets[-1]
    if cover.offsets[0] != 0 or cover.offsets[-1] != last or not never_falls(cover.offsets):
        raise InputError(f"offsets: do not rise from 0 to {last}")


def _check_splines(splines: LocalSplines | LocalColumns) -> None:
    _check_kernel(splines.kernel, splines.exponents.shape[1])
    dimension, last = splines.kernel.dimension, len(splines.sites)

    def within(start: int, stop: int) -> BoolArray:
        ends = splines.places[start:stop] + dimension * np.diff(splines.offsets[start : stop + 1])
        return np.asarray(ends <= last)

    if not everywhere(len(splines.places), within):
        raise InputError("places: lead beyond the end of the sites")
    if isinstance(splines, LocalSplines) and splines.trials is not None:
        _check_trials(splines.trials)


def _check_trials(trials: Any) -> None:
    """Check what balls choose their smoothing among: `SharedTrials`, of a file a plain tuple."""
    names = SharedTrials._fields
    if not isinstance(trials, tuple) or len(trials) != len(names):
        raise InputError(f"trials: are not {', '.join(names)}")
    sizes: Sizes = {}
    values, inverses, usual, *factors = trials
    floats("m").check(values, names[0], sizes)
    floats("g", "m", "g", "g").check(inverses, names[1], sizes)
    if not isinstance(usual, int) or not 0 <= usual < len(values) or not all(isinstance(x, float) for x in factors):
        raise InputError(f"trials: have {usual!r} of {len(values)} for the usual one, and {factors}")


def _check_potentials(potentials: LocalPotentials) -> None:
    _check_kernel(potentials.kernel, potentials.exponents.shape[1])


def _check_kernel(kernel: object, dimension: int) -> None:
    if not isinstance(kernel, Polyharmonic) or kernel.dimension != dimension or not 1 <= kernel.power <= MAX_POWER:
        raise InputError(f"kernel: is {kernel!r}, in {dimension}-D")


def _check_sheets(creased: Any) -> None:
    if not isinstance(creased.splines, LocalSplines) or len(creased.composition) != len(creased.splines.tails):
        raise InputError("composition: is not of the splines")
    if not len(creased.first) or np.any(np.diff(creased.first) < 1):
        raise InputError("first: has balls without a sheet")


def _check_blend(blend: Any) -> None:
    """Check that cover, index and local fits have the same balls, of the same dimension."""
    cover, index, local = blend.cover, blend.index, blend.local
    for part, kinds in ((cover, Cover), (index, BallIndex), (local, Local)):
        if not isinstance(part, kinds):
            raise InputError(f"{type(blend).__name__}: contains a {type(part).__name__} in the place of a part")
    splines = local.splines if isinstance(local, LocalCreasedSplines) else local
    count = len(local.first) - 1 if isinstance(local, LocalCreasedSplines) else len(splines.tails)
    dimension = 2 if isinstance(splines, VectorSplines) else splines.exponents.shape[1]
    if not len(cover.radii) == count > (index.balls.max() if len(index.balls) else -1):
        raise InputError(f"{type(blend).__name__}: has {len(cover.radii)} balls and fits in {count}")
    if not cover.bounds.shape[1] == index.bounds.shape[1] == dimension:
        raise InputError(f"{type(blend).__name__}: its parts are of different dimensions")

    def alike(start: int, stop: int) -> bool:
        rows = slice(start, stop)
        balls, placed = index.balls[rows], cover.centers[index.balls[rows]] + index.shifts[rows]
        return np.array_equal(placed, index.centers[rows]) and np.array_equal(cover.radii[balls], index.radii[rows])

    if not everywhere(len(index.balls), alike):
        raise InputError(f"{type(blend).__name__}: its balls are not where its index has them")


def _check_height(height: Any) -> None:
    if not isinstance(height.interpolant, PUInterpolant) or height.interpolant.bounds.shape[1] != 2:
        raise InputError("HeightMap: is no function in the plane")


def _check_single(single: RBFInterpolant) -> None:
    if single.kernel.dimension != single.bounds.shape[1] or not single.radius > 0:
        raise InputError("RBFInterpolant: its kernel is of another dimension")
    if isinstance(single.kernel, Polyharmonic):
        _check_kernel(single.kernel, single.kernel.dimension)
    columns = Array(np.float64, ("m", "n"))
    sizes = {"n": single.points.shape[1]}
    columns.check(np.atleast_2d(single.weights), "weights", sizes)
    columns.check(np.atleast_2d(single.tail), "tail", sizes | {"n": len(single.exponents)})


def _check_frame(frame: LeafFrame) -> None:
    if np.any(np.diff(frame.breaks) <= 0):
        raise InputError("breaks: do not rise")
    if not (frame.axis.shape[1] > 1 and frame.axis[:, 1].any(axis=1).all() and frame.normal[:, 0].any(axis=1).all()):
        raise InputError("axis, normal: have no direction on a segment")


def _check_quilt(quilt: Quilt) -> None:
    if np.any(quilt.nodes < 1) or np.any(quilt.tile <= 0):
        raise InputError("Quilt: its tiles have no nodes, or no size")


def _check_zones(zones: HairZones) -> None:
    if zones.pieces.max() >= zones.pieces[0].size:
        raise InputError("HairZones: has more pieces than nodes")


def _check_wang(field: Any) -> None:
    if not isinstance(field.quilt, Quilt) or field.quilt.sources.max() >= len(field.fields):
        raise InputError("WangField: its tiles show patches that it does not have")


RELATIONS: tuple[tuple[Any, Callable[[Any], None]], ...] = (
    (Cover, _check_cover),
    (LocalSplines | LocalColumns, _check_splines),
    (LocalPotentials, _check_potentials),
    (LocalCreasedSplines, _check_sheets),
    (PUInterpolant | ChartSurface, _check_blend),
    (HeightMap, _check_height),
    (RBFInterpolant, _check_single),
    (LeafFrame, _check_frame),
    (Quilt, _check_quilt),
    (HairZones, _check_zones),
    (WangField, _check_wang),
)
"""What holds between the arrays of an object, or its parts, of each class."""
