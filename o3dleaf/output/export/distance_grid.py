"""The signed distance to a closed mesh on a regular grid: VTI, NRRD, or NPY with its metadata beside it."""

import json
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.atomic_files import require_free, require_writable, whole_file
from o3dleaf.core.checks import FloatArray, as_bounds, require_positive
from o3dleaf.core.parallel import Progress
from o3dleaf.leaf.distance.grid import envelope
from o3dleaf.output.export.labelled_mesh import AnyMesh, Surface
from o3dleaf.output.export.particles import columns_through

SUFFIXES = (".vti", ".nrrd", ".npy")
SLAB = 1 << 20
"""Grid points asked for at once, about: whole planes."""


def export_distance(
    path: str | PathLike[str],
    mesh: AnyMesh,
    spacing: float,
    bounds: npt.ArrayLike | None = None,
    *,
    unit: str | None = None,
    to_unit: str | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the signed distance to a closed mesh at the whole multiples of `spacing` in a box; negative inside.

    The distance is Open3D's to the triangles (single precision around the middle of the box), its sign from columns
    of the grid, which pass the mesh an odd number of times below a point inside. Values are float32, x fastest; NPY
    holds them as [k, j, i] and its metadata stands beside it in a file of the same name with .json. Of a leaf model,
    `MultiscaleLeaf.write_grid(what="distance", closed=True)` writes the distance to the implicit surface itself.

    Parameters
    ----------
    path : path-like
        .vti, .nrrd or .npy.
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Closed.
    spacing : float
        Step of the grid, in the mesh's unit.
    bounds : (2, 3) array_like, optional
        Lower, then upper corner, in the mesh's unit; by default the mesh's own box and four steps around it.
    unit : str, optional
        Unit of the mesh.
    to_unit : str, optional
        Unit of the file: coordinates and distances.
    progress : callable, optional
        ``progress(done, total)`` in grid points.

    Raises
    ------
    InputError
        If the mesh is open, the suffix is unknown or the folder cannot be written to.
    O3DLeafError
        If the disk has no room for the grid.
    """
    target = require_writable(path, SUFFIXES)
    surface = Surface.of(mesh, None, unit)
    ready = surface.in_unit(to_unit)
    scale = 1.0 if ready is surface else float(np.ptp(ready.vertices) / np.ptp(surface.vertices))
    step = require_positive(spacing, "spacing") * scale
    own = np.array([ready.vertices.min(axis=0) - 4 * step, ready.vertices.max(axis=0) + 4 * step])
    box = own if bounds is None else as_bounds(bounds, 3) * scale
    first = np.floor(box[0] / step + 1e-9)
    count = (np.ceil(box[1] / step - 1e-9) - first + 1).astype(int)
    shape = int(count[0]), int(count[1]), int(count[2])
    require_free(target, 4 * int(np.prod(shape, dtype=object)))
    column, height = columns_through(ready, first * step, step, shape)
    _write(target, _Distance(ready, first * step, step, shape, column, height), ready.unit, progress)


class _Distance:
    """The signed distance, some planes of the grid at a time."""

    def __init__(
        self,
        surface: Surface,
        origin: FloatArray,
        step: float,
        shape: tuple[int, int, int],
        column: npt.NDArray[np.int64],
        height: FloatArray,
    ) -> None:
        self.origin, self.step, self.shape = origin, step, shape
        self.column, self.height = column, height
        self.middle = origin + step * (np.array(shape) - 1) / 2
        self.scene = o3d.t.geometry.RaycastingScene()
        positions = o3d.core.Tensor.from_numpy(((surface.vertices - self.middle) / step).astype(np.float32))
        self.scene.add_triangles(positions, o3d.core.Tensor.from_numpy(surface.triangles.astype(np.uint32)))

    def planes(self, first: int, last: int) -> npt.NDArray[np.float32]:
        """Return (last − first, ny, nx) distances."""
        nx, ny, _ = self.shape
        k, j, i = np.meshgrid(np.arange(first, last), np.arange(ny), np.arange(nx), indexing="ij")
        points = (self.origin - self.middle) / self.step + np.stack([i, j, k], axis=-1)
        distance = self.scene.compute_distance(o3d.core.Tensor.from_numpy(points.astype(np.float32))).numpy()
        # How often each column has been passed below a plane: each crossing counts from the first plane above it.
        passed = np.ceil((self.height - self.origin[2]) / self.step).astype(np.int64)
        inside = np.zeros((last - first + 1, nx * ny), dtype=np.int64)
        reached = passed < last
        np.add.at(inside, (np.maximum(passed[reached] - first, 0), self.column[reached]), 1)
        odd = np.cumsum(inside[:-1], axis=0) % 2 == 1
        odd = odd.reshape(-1, nx, ny).transpose(0, 2, 1)
        values: npt.NDArray[np.float32] = np.where(odd, -distance, distance).astype(np.float32)
        return values * np.float32(self.step)


def _write(target: Path, distance: _Distance, unit: str | None, progress: Progress | None) -> None:
    shape, suffix = distance.shape, target.suffix.lower()
    per = max(SLAB // (shape[0] * shape[1]), 1)
    header, footer = b"", b""
    if suffix != ".npy":
        place = distance.origin, np.full(3, distance.step)
        header, footer = envelope(suffix, "distance", np.dtype(np.float32), shape, place, unit)
    with whole_file(target) as temporary, temporary.open("wb") as out:
        if suffix == ".npy":
            head = {"descr": "<f4", "fortran_order": False, "shape": shape[::-1]}
            np.lib.format.write_array_header_1_0(out, head)
        out.write(header)
        for k in range(0, shape[2], per):
            planes = distance.planes(k, min(k + per, shape[2]))
            out.write(planes.astype("<f4").tobytes())
            if progress:
                progress(min(k + per, shape[2]), shape[2])
        out.write(footer)
    if suffix == ".npy":
        meta: dict[str, Any] = {"what": "signed distance, negative inside", "axes": "[k, j, i]: z, y, x", "unit": unit}
        meta |= {"origin": distance.origin.tolist(), "spacing": distance.step}
        with whole_file(target.with_suffix(".json")) as temporary:
            temporary.write_text(json.dumps(meta, indent=1) + "\n")
