"""Samples on a lattice to triangles: marching cubes or marching tetrahedra.

Both give the same kind of mesh: vertices on the lattice's edges where the linear interpolant takes
the level, one vertex an edge, counter-clockwise seen from outside, edge- and vertex-manifold, closed
but where the surface leaves the lattice. A sample above the level is inside; one on the level is
outside, and the vertex beside it keeps a millionth of its edge from it.

Cubes give half as many triangles. Tetrahedra never intersect themselves, whatever the samples,
because each triangle lies in a tetrahedron of its own.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.isosurface.polygonize_loops import (
    FirstOfPlane,
    NamedMesh,
    count_planes,
    march_planes,
    place_vertices,
)

METHODS = ("cubes", "tetrahedra")


def polygonize(samples: npt.ArrayLike, level: float, method: str = "cubes") -> tuple[FloatArray, IntArray]:
    """Return the surface where the samples on a lattice cross a level.

    Parameters
    ----------
    samples : (nx, ny, nz) array_like
        Values at the lattice's points, larger inside.
    level : float
        The isovalue.
    method : {"cubes", "tetrahedra"}
        The extractor.

    Returns
    -------
    vertices : (n, 3) ndarray of float64
        In lattice coordinates: (i, j, k) is sample (i, j, k).
    triangles : (m, 3) ndarray of int64
        Counter-clockwise seen from outside; both are empty where nothing crosses the level.

    Raises
    ------
    InputError
        If the samples are no 3-D array with a cell, or are not finite.
    """
    values = np.ascontiguousarray(samples, dtype=np.float64)
    if values.ndim != 3 or min(values.shape) < 2:
        raise InputError(f"samples: have shape {values.shape}; give (nx, ny, nz), two or more along each axis")
    require_finite(values, "samples")
    kind = METHODS.index(require_choice(method, METHODS, "method"))
    crossings = march(values - level, values > level, kind)
    return crossings.positions(), crossings.triangles


@dataclass(frozen=True, eq=False)
class Crossings:
    """A surface on a lattice, its vertices named by the edges that they lie on.

    Attributes
    ----------
    shape : (3,) tuple of int
        Points of the lattice along each axis.
    edges : (n,) ndarray of int64
        8 · (number of the lower point) + direction, three bits; rising.
    fractions : (n,) ndarray of float64
        How far along its edge each vertex lies.
    triangles : (m, 3) ndarray of int64
        By cells, in the order of their lower points.
    """

    shape: tuple[int, int, int]
    edges: IntArray
    fractions: FloatArray
    triangles: IntArray

    def positions(self, start: tuple[int, int, int] = (0, 0, 0)) -> FloatArray:
        """Return the (n, 3) positions of the vertices in lattice coordinates, point (0, 0, 0) at `start`."""
        return lattice_positions(self.edges, self.fractions, self.shape, start)


def lattice_positions(
    edges: IntArray, fractions: FloatArray, shape: tuple[int, int, int], start: tuple[int, int, int] = (0, 0, 0)
) -> FloatArray:
    """Return the (n, 3) lattice coordinates of vertices on edges of a lattice of `shape` that begins at `start`."""
    vertices = np.empty((len(edges), 3))
    place_vertices(np.ascontiguousarray(edges), fractions, shape, start, vertices)
    return vertices


def march(values: FloatArray, inside: BoolArray, method: int) -> Crossings:
    """March a lattice in two passes over its x-planes: count, then fill.

    Parameters
    ----------
    values : (nx, ny, nz) ndarray
        Samples less the level.
    inside : (nx, ny, nz) ndarray of bool
        Which samples count as inside; where it contradicts the sign, the size of the value decides.
    method : int
        Place in `METHODS`.
    """
    planes = len(values)
    counts = np.zeros((2, planes), dtype=np.int64)
    block = max(1, planes // 64)
    run_blocks(lambda a, b: count_planes(method, inside, a, b, counts[0], counts[1]), planes, block)
    ends = np.zeros((2, planes + 1), dtype=np.int64)
    ends[:, 1:] = np.cumsum(counts, axis=1)
    offsets, (crossed, drawn) = FirstOfPlane(*ends), ends[:, -1]
    mesh = NamedMesh(np.empty(crossed, dtype=np.int64), np.empty(crossed), np.empty((drawn, 3), dtype=np.int64))
    run_blocks(lambda a, b: march_planes(method, values, inside, a, b, offsets, mesh), planes, block)
    return Crossings(values.shape, *mesh)
