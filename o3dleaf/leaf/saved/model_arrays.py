"""What the arrays of a model must be, before compiled loops index by them: a file may hold anything."""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.scratch import ROWS
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
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
from o3dleaf.leaf.parametric.thickness import ThicknessMap
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.hairs.zones import HairZones
from o3dleaf.leaf.texture.quilt import Quilt
from o3dleaf.leaf.texture.wang import WangField
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

Sizes = dict[str, int]

MOST_POWER = 99
"""Of a polyharmonic kernel; r^99 of single numbers overflows soon after."""
MOST_EXPONENT = 64
"""Of a monomial of a tail."""
MOST = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Array:
    """An array of a model: its type, its shape in letters that mean the same throughout an object, and its range.

    A letter that is new stands for any size. `most` is one of them or a number; where an array is `rising`, it begins
    with 0, never falls, and ends with `most`.
    """

    kind: type[np.generic]
    shape: tuple[str, ...]
    least: int = 0
    most: int | str = MOST
    rising: bool = False
    optional: bool = False

    def check(self, array: Any, name: str, sizes: Sizes) -> None:
        """Raise `InputError` unless an array is as it must be; learn the sizes that are new."""
        if array is None and self.optional:
            return
        if not isinstance(array, np.ndarray) or array.ndim != len(self.shape) or array.dtype != np.dtype(self.kind):
            raise InputError(f"{name}: is no array of {self.kind.__name__} with {len(self.shape)} axes")
        for letters, size in zip(self.shape, array.shape, strict=True):
            if size != (sizes.setdefault(letters, size) if letters.isalpha() else _evaluated(letters, sizes)):
                raise InputError(f"{name}: has shape {array.shape}, which does not fit the other arrays")
        if self.kind is np.float64:
            if not _everywhere(len(array), lambda start, stop: np.isfinite(array[start:stop])):
                raise InputError(f"{name}: has values that are NaN or infinite")
            return
        most = self.most if isinstance(self.most, int) else _evaluated(self.most, sizes)
        if array.size and not (self.least <= array.min() and array.max() <= most):
            raise InputError(f"{name}: has values from {array.min()} to {array.max()}, not from {self.least} to {most}")
        if self.rising and (array[0] != 0 or array[-1] != most or not _never_falls(array)):
            raise InputError(f"{name}: do not rise from 0 to {most}")


def _everywhere(count: int, holds: Callable[[int, int], Any]) -> bool:
    """Return whether something holds of all rows, asked of some at a time: what is mapped stays in its file."""
    return all(bool(np.all(holds(*part))) for part in blocks(count, ROWS))


def _never_falls(array: IntArray) -> bool:
    return _everywhere(len(array) - 1, lambda start, stop: array[start:stop] <= array[start + 1 : stop + 1])


def _evaluated(letters: str, sizes: Sizes) -> int:
    """Return the value of a sum of products, such as "2*n" or "k+1"; -1 takes one off."""
    return sum(
        prod(sizes[each] if each.isalpha() else int(each) for each in term.split("*")) for term in letters.split("+")
    )


def _floats(*shape: str, optional: bool = False) -> Array:
    return Array(np.float64, shape, optional=optional)


def _whole(*shape: str, least: int = 0, most: int | str = MOST) -> Array:
    return Array(np.int64, shape, least, most)


def _rising(count: str, total: str) -> Array:
    return Array(np.int64, (f"{count}+1",), 0, total, rising=True)


EXPONENTS = _whole("q", "d", most=MOST_EXPONENT)
SPLINES = {"exponents": EXPONENTS, "ranks": _whole("k"), "dropped": _whole("k"), "sites": _floats("s")}

ARRAYS: dict[type, dict[str, Array]] = {
    BallIndex: {
        "bounds": _floats("2", "d"),
        "period": _floats("d"),
        "balls": _whole("m"),
        "shifts": _floats("m", "d"),
        "centers": _floats("m", "d"),
        "radii": _floats("m"),
    },
    Cover: {
        "bounds": _floats("2", "d"),
        "centers": _floats("k", "d"),
        "radii": _floats("k"),
        "members": _whole("t"),
        "offsets": _whole("k+1"),
    },
    LocalSplines: {
        "tails": _floats("k", "q"),
        **SPLINES,
        "weights": _floats("t"),
        "offsets": _rising("k", "t"),
        "places": _whole("k", most="s"),
        "smoothing_per_ball": _floats("k", optional=True),
        "point_weights": _floats("t", optional=True),
        "point_groups": Array(np.int64, ("t",), optional=True),
    },
    LocalColumns: {
        "tails": _floats("k", "c", "q"),
        **SPLINES,
        "weights": _floats("c", "t"),
        "offsets": _rising("k", "t"),
        "places": _whole("k", most="s"),
        "smoothing_per_ball": _floats("k", optional=True),
    },
    Quilt: {
        "tile": _floats("2"),
        "sources": _whole("k"),
        "corners": _floats("k", "2"),
        "labels": _whole("16", "n", "m", most="k+-1"),
        "energy": _floats("3"),
    },
    HairZones: {
        "lids": _floats("2", "t", "n", "m"),
        "pieces": _whole("t", "n+1", "m+1", least=-1),
        "open_lids": _floats("2"),
    },
    ThinnedField: {"shares": _floats("p", "q"), "box": _floats("2", "2")},
    ThicknessMap: {"factors": _floats("n", "m"), "bounds": _floats("2", "2")},
    LocalPolynomials: {"tails": _floats("k", "q"), "exponents": EXPONENTS, "ranks": _whole("k")},
    LocalPotentials: {
        "tails": _floats("k", "q"),
        "exponents": EXPONENTS,
        "dropped": _whole("k"),
        "weights": _floats("t"),
        "sites": _floats("d*t"),
        "moments": _floats("d*t"),
        "offsets": _rising("k", "t"),
    },
    LocalCreasedSplines: {"composition": _whole("p", least=-1, most=1), "first": Array(np.int64, ("n",), 0, "p", True)},
    VectorSplines: {
        "tails": _floats("k", "3", "3"),
        "weights": _floats("3", "t"),
        "sites": _floats("2*t"),
        "offsets": _rising("k", "t"),
    },
    LeafFrame: {"axis": _floats("s", "n", "3"), "normal": _floats("s", "o", "3"), "breaks": _floats("s+1")},
    RBFInterpolant: {
        "bounds": _floats("2", "d"),
        "center": _floats("d"),
        "points": _floats("d", "n"),
        "exponents": EXPONENTS,
    },
}
"""Of each class, in an order in which every size is known before it is reckoned with."""

Local = LocalSplines | LocalColumns | LocalPolynomials | LocalPotentials | LocalCreasedSplines | VectorSplines


def check_model(model: object) -> None:
    """Raise `InputError` unless the arrays of an object from a file are of one piece; its parts are checked before it.

    Only what compiled loops rely on is looked at: types, sizes, and that no number leads outside an array.
    """
    sizes: Sizes = {}
    _check_arrays(model, sizes)
    for kinds, check in RELATIONS:
        if isinstance(model, kinds):
            check(model)


def _check_arrays(model: object, sizes: Sizes) -> None:
    for name, array in ARRAYS.get(type(model), {}).items():
        array.check(getattr(model, name), name, sizes)


def stored_index(
    *,
    bounds: Any,
    period: Any,
    balls: Any,
    shifts: Any,
    centres: Any,
    radii: Any,
    tree: object = None,  # noqa: ARG001 - of files of format 3; its own follows from the rest
) -> BallIndex:
    """Return the index of a file, or raise `InputError` where its parts are none of one."""
    sizes: Sizes = {}
    parts = {"bounds": bounds, "period": period, "balls": balls, "shifts": shifts, "centers": centres, "radii": radii}
    for name, array in ARRAYS[BallIndex].items():
        array.check(parts[name], name, sizes)
    if np.any(radii <= 0) or np.any(period < 0) or np.any(bounds[0] > bounds[1]):
        raise InputError("radii, period, bounds: are below zero, or the wrong way round")
    return BallIndex(**parts)


def _check_cover(cover: Cover) -> None:
    """Check the offsets; balls on a lattice have counts without members."""
    last = len(cover.members) or cover.offsets[-1]
    if cover.offsets[0] != 0 or cover.offsets[-1] != last or not _never_falls(cover.offsets):
        raise InputError(f"offsets: do not rise from 0 to {last}")


def _check_splines(splines: LocalSplines | LocalColumns) -> None:
    _check_kernel(splines.kernel, splines.exponents.shape[1])
    dimension, last = splines.kernel.dimension, len(splines.sites)

    def within(start: int, stop: int) -> BoolArray:
        ends = splines.places[start:stop] + dimension * np.diff(splines.offsets[start : stop + 1])
        return np.asarray(ends <= last)

    if not _everywhere(len(splines.places), within):
        raise InputError("places: lead beyond the end of the sites")


def _check_potentials(potentials: LocalPotentials) -> None:
    _check_kernel(potentials.kernel, potentials.exponents.shape[1])


def _check_kernel(kernel: object, dimension: int) -> None:
    if not isinstance(kernel, Polyharmonic) or kernel.dimension != dimension or not 1 <= kernel.power <= MOST_POWER:
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

    if not _everywhere(len(index.balls), alike):
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
