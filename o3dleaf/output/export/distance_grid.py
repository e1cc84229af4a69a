"""The signed distance to a closed mesh on a regular grid: VTI, NRRD, or NPY with its metadata beside it."""

from os import PathLike

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Unit
from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.mesh_arrays import ray_scene
from o3dleaf.core.parallel import blocks
from o3dleaf.io.grid import SUFFIXES, GridFile
from o3dleaf.io.labelled_mesh import AnyMesh
from o3dleaf.io.mesh_data import MeshData
from o3dleaf.output.export.particles import columns_through

SLAB = 1 << 20
"""Grid points evaluated at once, about: whole planes."""


@checked
def export_distance(
    mesh: AnyMesh,
    path: str | PathLike[str],
    spacing: Positive,
    bounds: npt.ArrayLike | None = None,
    *,
    unit: Unit | None = None,
    to_unit: Unit | None = None,
) -> None:
    """Write the signed distance to a closed mesh at the whole multiples of `spacing` in a box; negative inside.

    The distance is Open3D's to the triangles (single precision around the middle of the box), its sign from columns
    of the grid, which pass the mesh an odd number of times below a point inside. Values are float32, x fastest; NPY
    holds them as [k, j, i] and its metadata stands beside it in a file of the same name with .json. Of a leaf model,
    `MultiscaleLeaf.write_grid(what="distance", closed=True)` writes the distance to the implicit surface itself.

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Closed.
    path : path-like
        .vti, .nrrd or .npy.
    spacing : float
        Step of the grid, in the mesh's unit.
    bounds : (2, 3) array_like, optional
        Lower, then upper corner, in the mesh's unit; by default the mesh's own box and four steps around it.
    unit : str, optional
        Unit of the mesh.
    to_unit : str, optional
        Unit of the file: coordinates and distances.

    Raises
    ------
    InputError
        If the mesh is open, the suffix is unknown or the folder cannot be written to.
    O3DLeafError
        If the disk has no room for the grid.
    """
    require_writable(path, SUFFIXES)
    given = MeshData.of(mesh, None, unit)
    ready = given.in_unit(to_unit)
    scale = 1.0 if ready is given else float(np.ptp(ready.vertices) / np.ptp(given.vertices))
    step = require_positive(spacing, "spacing") * scale
    around_mesh = np.array([ready.vertices.min(axis=0) - 4 * step, ready.vertices.max(axis=0) + 4 * step])
    box = around_mesh if bounds is None else as_bounds(bounds, 3) * scale
    grid = GridFile.plan(path, step, box, "distance", ready.unit)
    tracing, writing = progress.split(0, 1)
    with tracing:
        distance = _Distance(ready, grid, step)
    with writing:
        per = max(SLAB // (grid.shape[0] * grid.shape[1]), 1)
        grid.write(distance.planes(first, last) for first, last in blocks(grid.shape[2], per))


class _Distance:
    """The signed distance, some planes of the grid at a time."""

    def __init__(self, mesh: MeshData, grid: GridFile, step: float) -> None:
        self.origin, self.step, self.shape = grid.origin, step, grid.shape
        self.column, self.height = columns_through(mesh, self.origin, step, self.shape)
        self.middle = self.origin + step * (np.array(self.shape) - 1) / 2
        self.scene = ray_scene((mesh.vertices - self.middle) / step, mesh.triangles)

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
