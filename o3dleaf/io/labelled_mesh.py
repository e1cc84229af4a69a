"""A triangle mesh that knows which part each of its triangles belongs to."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

LabelArray = npt.NDArray[np.uint8]

LABELS = ("adaxial", "abaxial", "rim")
"""Names of the labels 0, 1 and 2 of a leaf, which the labels of a file have if it names none."""


@dataclass(frozen=True, eq=False, repr=False)
class LabelledMesh:
    """A triangle mesh that knows which part of the leaf each triangle belongs to.

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
        parts += [] if self.labels is None else ["labels " + ", ".join(self.names)]
        parts += [] if self.unit is None else [f"unit {self.unit}"]
        return f"LabelledMesh({'; '.join(parts)})"
