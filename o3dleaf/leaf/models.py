"""Models that were saved, read again: interpolants, tiled fields and whole leaves."""

from functools import partial
from os import PathLike
from typing import Any

from o3dleaf.fitting.creases.creases import CreasedSplines
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.pu.local import LocalSplines
from o3dleaf.fitting.pu.oriented import LocalPolynomials, LocalPotentials
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.io.model_file import read_model
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.macro.robust import RobustChoice
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField

CLASSES: dict[str, type[Any]] = {
    each.__name__: each
    for each in (
        AlphaShape,
        BallIndex,
        Blade,
        Cover,
        CreasedSplines,
        HeightMap,
        LeafFrame,
        LocalPolynomials,
        LocalPotentials,
        LocalSplines,
        MultiscaleLeaf,
        PatchBlend,
        PUInterpolant,
        Polyharmonic,
        RBFInterpolant,
        RobustChoice,
        Smoothing,
        TiledField,
    )
}


FIELDS: dict[str, dict[str, str]] = {"RobustChoice": {"trust": "weights"}}
"""Fields that files know by another name, by class: the names of format 3 stay, so that any version reads any file."""


def load(path: str | PathLike[str]) -> Any:
    """Return the interpolant, tiled field or leaf of a model file that ``save`` wrote.

    The arrays stay on disk until they are used.

    Parameters
    ----------
    path : path-like
        A .o3l file.

    Raises
    ------
    InputError
        If the file is no model, was damaged or cut off, or was written by a later version.
    """
    return read_model(path, CLASSES | {name: partial(_make, name) for name in FIELDS})


def _make(name: str, **state: Any) -> Any:
    """Return an object of a class by its state in a file."""
    return CLASSES[name](**{FIELDS[name].get(field, field): value for field, value in state.items()})
