"""Samples on a lattice to triangles: marching cubes (scikit-image) or marching tetrahedra (ours).

Both give the same kind of mesh: vertices on the lattice's edges where the linear interpolant takes
the level, one vertex an edge, counter-clockwise seen from outside, edge- and vertex-manifold, closed
but where the surface leaves the lattice. A sample above the level is inside; one on the level is
outside, and the vertex beside it keeps a millionth of its edge from it.

Cubes give half as many triangles; the choice in an ambiguous cell is the asymptotic decider's
(Lewiner et al. 2003, J. Graphics Tools 8(2)). Tetrahedra never intersect themselves, whatever the
samples, because each triangle lies in a tetrahedron of its own.
"""

import numpy as np
import numpy.typing as npt
from skimage.measure import marching_cubes

from o3dleaf.checks import FloatArray, require_choice, require_finite
from o3dleaf.errors import InputError
from o3dleaf.lattice import check_keep
from o3dleaf.mesh.arrays import BoolArray, IntArray
from o3dleaf.mesh.clip import discard_triangles
from o3dleaf.mesh.loops import LEAST_FRACTION, count_planes, march_planes
from o3dleaf.parallel import run_blocks

METHODS = ("cubes", "tetrahedra")


def polygonise(
    samples: npt.ArrayLike, level: float, method: str = "cubes", keep: npt.ArrayLike | None = None
) -> tuple[FloatArray, IntArray]:
    """Return the surface where the samples on a lattice cross a level.

    Parameters
    ----------
    samples : (nx, ny, nz) array_like
        Values at the lattice's points, larger inside.
    level : float
        The isovalue.
    method : {"cubes", "tetrahedra"}
        The extractor.
    keep : (nx, ny) array_like of bool, optional
        Columns whose samples are true ones. A vertex that leans on another column is left out with
        its triangles, so that the surface ends there, open.

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
    march = _march_cubes if require_choice(method, METHODS, "method") == "cubes" else _march_tetrahedra
    inside = values > level
    if inside.all() or not inside.any():
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    vertices, triangles = march(values, inside, float(level))
    if keep is None:
        return vertices, triangles
    return discard_triangles(vertices, triangles, _lean_on(vertices, check_keep(keep, values.shape[:2])))


def _march_tetrahedra(samples: FloatArray, inside: BoolArray, level: float) -> tuple[FloatArray, IntArray]:
    """March Kuhn's tetrahedra in two passes over the x-planes: count, then fill."""
    planes = len(samples)
    counts = np.zeros((2, planes), dtype=np.int64)
    block = max(1, planes // 64)
    run_blocks(lambda start, stop: count_planes(inside, start, stop, counts[0], counts[1]), planes, block)
    offsets = np.zeros((2, planes + 1), dtype=np.int64)
    offsets[:, 1:] = np.cumsum(counts, axis=1)
    mesh = np.empty((offsets[0, -1], 3)), np.empty((offsets[1, -1], 3), dtype=np.int64)

    def march(start: int, stop: int) -> None:
        march_planes(samples, inside, level, (start, stop), (offsets[0], offsets[1]), mesh)

    run_blocks(march, planes, block)
    return mesh


def _march_cubes(samples: FloatArray, inside: BoolArray, level: float) -> tuple[FloatArray, IntArray]:
    """March cubes by scikit-image for the connectivity, and place the vertices in float64 ourselves."""
    compressed = _compress(samples - level, inside)
    rough, triangles, _, _ = marching_cubes(compressed, 0.0, gradient_direction="ascent")  # type: ignore[no-untyped-call]
    vertices = rough.astype(np.float64)
    lower = np.floor(vertices).astype(np.int64)
    upper = np.ceil(vertices).astype(np.int64)
    on_edge = (upper - lower).sum(axis=1) == 1
    low, high = lower[on_edge], upper[on_edge]
    here, there = samples[tuple(low.T)], samples[tuple(high.T)]
    fraction = np.clip((level - here) / (there - here), LEAST_FRACTION, 1 - LEAST_FRACTION)
    vertices[on_edge] = low + (high - low) * fraction[:, np.newaxis]
    return vertices, triangles.astype(np.int64)


def _compress(shifted: FloatArray, inside: BoolArray) -> npt.NDArray[np.float32]:
    """Return float32 values that scikit-image joins as it would join `shifted`, without its accidents.

    A power keeps every sign and the order of the products of opposite corners, which decide the
    ambiguous faces, while it brings all sizes to within a factor of 10 of one another: each vertex
    comes back well inside its edge, so that float32 still tells which edge it is. Where the two
    products are equal the neighbours of a face could decide differently (non-manifold edges on
    integer data); the parity of the lattice point tips every such balance by one part in 10^5.
    """
    size = np.abs(shifted)
    size /= np.median(size[size > 0]) if size.any() else 1.0
    size = np.clip(size, 1e-16, 1e16) ** (1 / 32)
    i, j, k = np.ix_(*(np.arange(n) & 1 for n in shifted.shape))
    size *= 1 + 1e-5 * (i * j + j * k + k * i)
    return np.where(inside, size, -size).astype(np.float32)


def _lean_on(vertices: FloatArray, keep: BoolArray) -> BoolArray:
    """Return which vertices interpolate samples of kept columns only."""
    (i, j), (u, v) = (bound(vertices[:, :2]).astype(np.int64).T for bound in (np.floor, np.ceil))
    return np.asarray(keep[i, j] & keep[i, v] & keep[u, j] & keep[u, v])
