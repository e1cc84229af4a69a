"""Requirements on the arrays of a model, before compiled loops index by them: a file may hold anything."""

from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.local.polynomials import LocalPolynomials
from o3dleaf.fitting.local.potentials import LocalPotentials
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.leaf.parametric.splines import VectorSplines
from o3dleaf.leaf.parametric.thickness import ThicknessMap
from o3dleaf.leaf.saved.array_kinds import Array, Sizes, floats, rising, whole
from o3dleaf.leaf.saved.relations import RELATIONS
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.hairs.zones import HairZones
from o3dleaf.leaf.texture.wang.quilt import Quilt
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

MAX_EXPONENT = 64
"""Of a monomial of a tail."""

EXPONENTS = whole("q", "d", most=MAX_EXPONENT)
SPLINES = {"exponents": EXPONENTS, "ranks": whole("k"), "dropped": whole("k"), "sites": floats("s")}

ARRAYS: dict[type, dict[str, Array]] = {
    BallIndex: {
        "bounds": floats("2", "d"),
        "period": floats("d"),
        "balls": whole("m"),
        "shifts": floats("m", "d"),
        "centers": floats("m", "d"),
        "radii": floats("m"),
    },
    Cover: {
        "bounds": floats("2", "d"),
        "centers": floats("k", "d"),
        "radii": floats("k"),
        "members": whole("t"),
        "offsets": whole("k+1"),
    },
    LocalSplines: {
        "tails": floats("k", "q"),
        **SPLINES,
        "weights": floats("t"),
        "offsets": rising("k", "t"),
        "places": whole("k", most="s"),
        "smoothing_per_ball": floats("k", optional=True),
        "point_weights": floats("t", optional=True),
        "point_groups": Array(np.int64, ("t",), optional=True),
        "stretches": floats("k", "d", "d", optional=True),
    },
    LocalColumns: {
        "tails": floats("k", "c", "q"),
        **SPLINES,
        "weights": floats("c", "t"),
        "offsets": rising("k", "t"),
        "places": whole("k", most="s"),
        "smoothing_per_ball": floats("k", optional=True),
    },
    Quilt: {
        "tile": floats("2"),
        "sources": whole("k"),
        "corners": floats("k", "2"),
        "labels": whole("16", "n", "m", most="k+-1"),
        "energy": floats("3"),
    },
    HairZones: {
        "lids": floats("2", "t", "n", "m"),
        "pieces": whole("t", "n+1", "m+1", least=-1),
        "open_lids": floats("2"),
    },
    ThinnedField: {"shares": floats("p", "q"), "box": floats("2", "2")},
    ParametricBlade: {"other_pieces": floats("n", "3", optional=True)},
    ThicknessMap: {"factors": floats("n", "m"), "bounds": floats("2", "2")},
    LocalPolynomials: {"tails": floats("k", "q"), "exponents": EXPONENTS, "ranks": whole("k")},
    LocalPotentials: {
        "tails": floats("k", "q"),
        "exponents": EXPONENTS,
        "dropped": whole("k"),
        "weights": floats("t"),
        "sites": floats("d*t"),
        "moments": floats("d*t"),
        "offsets": rising("k", "t"),
    },
    LocalCreasedSplines: {"composition": whole("p", least=-1, most=1), "first": Array(np.int64, ("n",), 0, "p", True)},
    VectorSplines: {
        "tails": floats("k", "3", "3"),
        "weights": floats("3", "t"),
        "sites": floats("2*t"),
        "offsets": rising("k", "t"),
    },
    LeafFrame: {"axis": floats("s", "n", "3"), "normal": floats("s", "o", "3"), "breaks": floats("s+1")},
    RBFInterpolant: {
        "bounds": floats("2", "d"),
        "center": floats("d"),
        "points": floats("d", "n"),
        "exponents": EXPONENTS,
    },
}
"""Of each class, in an order in which every size is known before it is reckoned with."""


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
