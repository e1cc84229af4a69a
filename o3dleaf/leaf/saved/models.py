"""Models that were saved, read again: interpolants, tiled fields and whole leaves."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any
from uuid import uuid4

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.local.polynomials import LocalPolynomials
from o3dleaf.fitting.local.potentials import LocalPotentials
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.shaped.shaped_kernels import Shaped
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.io.models.model_file import read_model, stored_class
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.chart.petiole import Petiole
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.macro.robust import RobustChoice
from o3dleaf.leaf.margin.gaps.hole import Hole
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.leaf.parametric.splines import VectorSplines
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.parametric.thickness import ThicknessMap
from o3dleaf.leaf.saved.model_arrays import check_model, stored_index
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.hairs.zones import HairZones
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.quilt import Quilt
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

CLASSES: dict[str, Callable[..., Any]] = {
    stored_class(each): each
    for each in (
        AlphaShape,
        ChartSurface,
        Cover,
        HeightMap,
        HairZones,
        HeightMapBlade,
        Hole,
        LeafFrame,
        LocalColumns,
        LocalCreasedSplines,
        LocalPolynomials,
        LocalPotentials,
        LocalSplines,
        Margin,
        MultiscaleLeaf,
        ParametricBlade,
        PatchBlend,
        Petiole,
        PUInterpolant,
        Polyharmonic,
        Quilt,
        RBFInterpolant,
        RobustChoice,
        Shaped,
        Smoothing,
        ThicknessMap,
        ThinnedField,
        TiledField,
        VectorSplines,
        WangField,
    )
} | {"BallIndex": stored_index, "CreasedSplines": LocalCreasedSplines}
"""What makes the objects of files, by their names there; the last name is that of version 0.1."""


@checked
def load(path: str | PathLike[str]) -> Any:
    """Return the interpolant, tiled field or leaf of a model file that ``save`` wrote.

    The arrays are checked against the sums in the file and against one another, and stay on disk until they are used.

    Parameters
    ----------
    path : path-like
        A .o3l file.

    Raises
    ------
    InputError
        If the file is no model, was damaged or cut off, or was written by a later version.
    """
    return read_model(path, CLASSES, check_model)


def load_texture(path: str | PathLike[str]) -> TiledField | PatchBlend | WangField:
    """Return the texture of a model file: of a texture, or of a leaf that has it, with all its hairs.

    Raises
    ------
    InputError
        If the file is no model, or one without a texture.
    """
    model = load(path)
    texture = model.texture if isinstance(model, MultiscaleLeaf) else model
    if isinstance(texture, ThinnedField):
        texture = texture.texture
    if not isinstance(texture, TiledField | PatchBlend | WangField):
        raise InputError(f"{path}: contains a {type(model).__name__}, no micro-structure; give one that `patch` wrote")
    return texture


@dataclass(frozen=True)
class SavedTexture:
    """The texture of a model file, as another process reads it.

    Attributes
    ----------
    path : str
        From the root on.
    name : str
        Of this state of the file: another one is read again.
    """

    path: str
    name: str

    @classmethod
    def of(cls, path: Path) -> "SavedTexture":
        """Return the texture of the file as it is now."""
        return cls(str(path.absolute()), uuid4().hex)

    def __call__(self) -> TiledField | PatchBlend | WangField:
        """Read it, once in a process."""
        return _loaded(self)


@lru_cache(maxsize=1)
def _loaded(saved: SavedTexture) -> TiledField | PatchBlend | WangField:
    return load_texture(saved.path)


def load_leaf(path: str | PathLike[str]) -> Blade | MultiscaleLeaf:
    """Return the leaf, or the blade, of a model file.

    Raises
    ------
    InputError
        If the file is no model, or that of something else.
    """
    model = load(path)
    if not isinstance(model, Blade | MultiscaleLeaf):
        raise InputError(f"{path}: contains a {type(model).__name__}, no leaf; give a model that `leaf --model` wrote")
    return model
