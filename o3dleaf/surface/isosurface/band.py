"""Any Field to triangles in a narrow band: the cells that the surface crosses are followed from seeds."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_mask, as_number, as_points, as_step, require_finite, require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import BoolArray, build_mesh
from o3dleaf.core.parallel import Progress, finish, share_out
from o3dleaf.surface.isosurface.wavefront import Band

APART = 4
"""One seed is used of those in a block of so many cells along each axis; the band grows from one to the next."""

ASKED = 36
"""Points of the lattice that a band asks for each seed used: 31 to 37, on clouds as dense as the lattice."""

SHARES = (1, 8, 6)
"""About how long seeds, growing and drawing take."""

NEWTON_STEPS = 3
"""Steps of a seed towards the surface; each squares what is left, so that three take a cell to rounding."""

SETTLED = 1e-3
"""Share of a cell: a seed whose last step was shorter lies on the surface."""

Within = float | Callable[[FloatArray], npt.NDArray[np.bool_]]
"""How far a band may grow: a reach from the seeds, or a function that says it of (n, 3) centres of cells."""


def extract_band(
    field: Field,
    spacing: float | npt.ArrayLike,
    seeds: npt.ArrayLike,
    *,
    within: Within | None = None,
    isovalue: float = 0.0,
    sharpen: bool = True,
    features: bool = False,
    progress: Progress | None = None,
) -> o3d.geometry.TriangleMesh:
    r"""Return the parts of the surface {x : F(x) = isovalue} that seeds lie on as an Open3D triangle mesh.

    The surface is that of `extract_isosurface` on the whole multiples of `spacing`, but the field is asked only at
    the corners of cells that the surface crosses and of their neighbours across crossed faces: time and memory grow
    with the area, not with the box. Parts of the surface that no seed leads to are not found.

    Parameters
    ----------
    field : Field
        Larger inside, of three dimensions, with gradients.
    spacing : float or (3,) array_like
        Lattice step, in the field's unit.
    seeds : (n, 3) array_like
        Points near the surface, such as the data, in the field's unit; the first in each block of 4 × 4 × 4 cells
        is moved onto the surface by Newton's method, :math:`x - F \nabla F / |\nabla F|^2`.
    within : float or callable, optional
        Cells whose centre lies farther than this from all seeds, or for whose centres (n, 3) the function returns
        False, are left out: the surface ends there, open. Left out, the band grows until it is closed.
        `near_data` makes such a function of a cloud.
    isovalue : float
        The field is larger than this inside.
    sharpen : bool
        Ask the field once more at every vertex and move it along its edge to the zero of the parabola through the
        three values: off by O(spacing^3) at most where the field is smooth, instead of O(spacing^2).
    features : bool
        Ask for the gradient at every vertex; where two in one cell are more than 26° apart, the cell gets one vertex
        more, where the tangent planes of its vertices meet (half a cell beside it at most), and neighbours of the
        kind are joined: creases of the field come out as edges, which marching cubes chamfers. Manifold all the
        same; triangles may cross where the field turns within a cell.
    progress : callable, optional
        ``progress(done, total)``, in shares of the work; how far the band will grow is guessed from the seeds.

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices in the field's unit, one for each crossed edge; triangles counter-clockwise seen from
        outside, manifold, the same whatever the number of threads.

    Raises
    ------
    InputError
        If an argument cannot be meant, or the seeds reach over a quarter of a million cells.
    ReconstructionError
        If no seed leads to the surface.

    References
    ----------
    Wyvill, McPheeters and Wyvill (1986), Data structure for soft objects: cells followed across crossed faces.
    Kobbelt, Botsch, Schwanecke and Seidel (2001), Feature sensitive surface extraction from volume data.
    """
    points, step, level = as_points(seeds, "seeds", dim=3, least=1), as_step(spacing), as_number(isovalue, "isovalue")
    allowed = _as_test(within, points)
    band = Band.around(points, field, level, step)
    seeding, growing, drawing = share_out(progress, *SHARES)
    thin = _thin(points, step)
    cells = band.cells_of(_toward_zero(field, thin, level, SETTLED * float(step.min())))
    if callable(within):
        cells = band.only(cells, allowed)
    finish(seeding)
    told = _growth(band, ASKED * len(thin), growing)
    while len(cells):
        cells = band.only(band.advance(cells, told), allowed)
    finish(growing)
    if not band.found:
        raise ReconstructionError(
            f"seeds: none of {len(points)} leads to a cell that the surface {isovalue:g} crosses; give points near it, "
            "or a finer spacing"
        )
    vertices, triangles = band.draw(sharpen=sharpen, ends=allowed is not None, features=features, progress=drawing)
    finish(drawing)
    return build_mesh(vertices, triangles)


def _growth(band: Band, expected: int, progress: Progress | None) -> Progress | None:
    """Return a progress for each wave of the band, of which about so many points of the lattice are `expected`."""
    if progress is None:
        return None

    def told(done: int, total: int) -> None:
        # The next wave is about as large.
        progress(band.count - total + done, max(expected, band.count + total))

    return told


def _as_test(within: Within | None, seeds: FloatArray) -> Callable[[FloatArray], BoolArray] | None:
    """Return `within` as a function of (n, 3) points."""
    if within is None:
        return None
    if callable(within):
        test = within
        return lambda centres: as_mask(test(centres), (len(centres),), "within")
    reach, tree = require_positive(within, "within"), cKDTree(seeds)
    return lambda centres: np.isfinite(tree.query(centres, distance_upper_bound=reach, workers=-1)[0])


def _thin(seeds: FloatArray, step: FloatArray) -> FloatArray:
    """Return the first seed of each block of cells."""
    block = np.floor(seeds / (APART * step))
    block -= block.min(axis=0)
    width = block.max(axis=0) + 1
    if np.prod(width) < 2.0**62:
        whole = width.astype(np.int64)
        place = (block[:, 0].astype(np.int64) * whole[1] + block[:, 1].astype(np.int64)) * whole[2]
        first = np.unique(place + block[:, 2].astype(np.int64), return_index=True)[1]
    else:
        first = np.unique(block, axis=0, return_index=True)[1]
    return np.asarray(seeds[np.sort(first)])


def _toward_zero(field: Field, points: FloatArray, level: float, settled: float) -> FloatArray:
    """Return points moved towards F = level by Newton's method along the gradient, each step within the bounds.

    A point that has moved less than `settled` stays: what is left is the square of that.
    """
    box = np.asarray(field.bounds)
    longest = float(np.linalg.norm(box[1] - box[0]))
    moved, asked = points.copy(), np.arange(len(points))
    for _ in range(NEWTON_STEPS):
        value, slope = values_and_gradients(field, moved[asked])
        value = value - level
        steep = np.maximum(np.linalg.norm(slope, axis=1), np.finfo(np.float64).tiny)
        # Where the field is flat the quotient may be beyond all numbers.
        length = value / np.maximum(steep, np.abs(value) / longest)
        moved[asked] -= (length / steep)[:, np.newaxis] * slope
        asked = asked[np.abs(length) > settled]
        if not len(asked):
            break
    return require_finite(moved, "seeds moved onto the surface")
