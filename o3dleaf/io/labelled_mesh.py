"""A triangle mesh with a label for the part that each triangle belongs to, and the names of labels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, cast, overload

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import MeshLike

Options = ParamSpec("Options")
LabelArray = npt.NDArray[np.uint8]

LABELS = ("adaxial", "abaxial", "rim")
"""Names of the labels 0, 1 and 2 of a leaf, which the labels of a file have if it names none."""
MAX_LABELS = 256
"""Number of labels that one byte distinguishes."""

ADAXIAL, ABAXIAL, RIM = range(len(LABELS))
"""Upper side, lower side and rim of the solid, as `o3dleaf.leaf.instancing.components` numbers them."""


@dataclass(frozen=True, eq=False, repr=False)
class LabelledMesh:
    """A triangle mesh with a label for the part of the leaf that each triangle belongs to.

    Attributes
    ----------
    mesh : open3d.geometry.TriangleMesh
        Faces counter-clockwise seen from outside.
    labels : (m,) ndarray of uint8, or None
        Of each triangle, an index into `names`; None where nobody labelled them.
    names : tuple of str
        Of the labels 0, 1, ...; the leaf's own are adaxial, abaxial and rim.
    unit : str, optional
        Unit of length, where it is known.
    """

    mesh: o3d.geometry.TriangleMesh
    labels: LabelArray | None = None
    names: tuple[str, ...] = LABELS
    unit: str | None = None

    def __repr__(self) -> str:
        parts = [f"{len(self.mesh.vertices):,} vertices", f"{len(self.mesh.triangles):,} triangles"]
        parts += [] if self.labels is None else [f"labels {'/'.join(self.names)}"]
        parts += [] if self.unit is None else [f"unit {self.unit}"]
        return f"LabelledMesh({', '.join(parts)})"

    def labels_of(self, triangles: int) -> npt.NDArray[Any] | None:
        """Return the labels, or None where there are none, and raise `InputError` if they are not one a triangle."""
        if self.labels is None:
            return None
        labels = np.asarray(self.labels)
        if labels.shape[:1] != (triangles,):
            raise InputError(f"labels: has shape {labels.shape}; give one per triangle, {triangles} in all")
        return labels


AnyMesh = MeshLike | LabelledMesh
"""What is written: a mesh, with labels or without."""


class MeshFunction(Protocol[Options]):
    """A function of a mesh that returns what it was given: a mesh with labels, or an Open3D mesh."""

    @overload
    def __call__(self, mesh: LabelledMesh, *args: Options.args, **options: Options.kwargs) -> LabelledMesh: ...

    @overload
    def __call__(self, mesh: MeshLike, *args: Options.args, **options: Options.kwargs) -> o3d.geometry.TriangleMesh: ...


def with_or_without_labels(
    function: Callable[Concatenate[LabelledMesh, Options], LabelledMesh],
) -> MeshFunction[Options]:
    """Make a function of labelled meshes one that takes and returns bare meshes as well."""

    @wraps(function)
    def either(mesh: Any, *args: Options.args, **options: Options.kwargs) -> Any:
        if isinstance(mesh, LabelledMesh):
            return function(mesh, *args, **options)
        return function(LabelledMesh(mesh), *args, **options).mesh

    return cast(MeshFunction[Options], either)


def name_labels(labels: LabelArray, named: Mapping[int, str] | None = None) -> tuple[str, ...]:
    """Return the names of the labels of a file, where it names some of them: the others have the leaf's, or numbers."""
    given = named or {}
    count = max(int(labels.max(initial=0)) + 1, len(given) or len(LABELS))
    usual = (*LABELS, *map(str, range(len(LABELS), MAX_LABELS)))
    return tuple(given.get(number, usual[number]) for number in range(count))


def label_parts(parts: list[tuple[str, int]]) -> tuple[LabelArray, tuple[str, ...]]:
    """Return the label of each triangle of consecutive parts (name, triangles), and the names.

    The leaf's own names get its numbers, others the next ones as they come.

    Raises
    ------
    InputError
        If there are too many names.
    """
    names = [*LABELS] if any(name in LABELS for name, _ in parts) else []
    names += [name for name in dict.fromkeys(name for name, _ in parts) if name not in names]
    if len(names) > MAX_LABELS:
        raise InputError(
            f"mesh: has {len(names)} solids or groups; at most {MAX_LABELS} can be read; merge some of them"
        )
    numbers = np.array([names.index(name) for name, _ in parts], dtype=np.uint8)
    return np.repeat(numbers, [count for _, count in parts]), tuple(names)
