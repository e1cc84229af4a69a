"""Any field to triangles: on the whole lattice of a box, or continued from seeds where the surface is."""

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks import FloatArray, as_bounds, as_number, as_points, as_step, require_choice, require_one_column
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.field import Field
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.mesh_arrays import IntArray, build_mesh
from o3dleaf.surface.isosurface.continuation import Within, continue_from_seeds
from o3dleaf.surface.isosurface.polygonize import METHODS, polygonize


def extract_isosurface(
    field: Field,
    spacing: float | npt.ArrayLike,
    bounds: npt.ArrayLike | None = None,
    isovalue: float = 0.0,
    *,
    method: str = "cubes",
    seeds: npt.ArrayLike | None = None,
    within: Within | None = None,
    sharpen: bool = True,
    features: bool = False,
) -> o3d.geometry.TriangleMesh:
    r"""Return the surface {x : F(x) = isovalue} of a field as an Open3D triangle mesh.

    The field is sampled at the whole multiples of `spacing`, so that the surface does not depend on
    the box that it is cut from, and its vertices are where the linear interpolant along a lattice
    edge takes the isovalue: they lie within O(spacing^2) of the surface.

    With `seeds`, those parts of the surface are extracted that seeds lie on (continuation): the field is evaluated only
    at the corners of cells that the surface crosses and of their neighbors across crossed faces, so that time and
    memory grow with the area, not with the box. Parts of the surface that no seed leads to are not found.

    Parameters
    ----------
    field : Field
        Larger inside, of three dimensions; with seeds, with gradients.
    spacing : float or (3,) array_like
        Lattice step, in the field's unit.
    bounds : (2, 3) array_like, optional
        Lower, then upper corner of the box, in the field's unit. Left out, it is the field's own,
        grown by one step, beyond which a field falls with the distance: a surface that touches the
        bounds is closed there. A surface that leaves a box is open where it does.
    isovalue : float
        The field is larger than this inside.
    method : {"cubes", "tetrahedra"}
        Marching cubes or marching tetrahedra (twice the triangles, free of
        self-intersection whatever the field).
    seeds : (n, 3) array_like, optional
        Points near the surface, such as the data, in the field's unit; the first in each block of 4 × 4 × 4 cells
        is moved onto the surface by Newton's method, :math:`x - F \nabla F / |\nabla F|^2`.
    within : float or callable, optional
        With seeds: cells whose center lies farther than this from all of them, or for whose centers (n, 3) the
        function returns False, are left out; the surface ends there, open. Left out, it is followed until it is
        closed. `distance_mask` makes such a function of a cloud.
    sharpen : bool
        With seeds: evaluate the field once more at every vertex and move it along its edge to the zero of the parabola
        through the three values: off by O(spacing^3) at most where the field is smooth, instead of O(spacing^2).
    features : bool
        With seeds: evaluate the gradient at every vertex; where two in one cell are more than 26° apart, the cell
        gets one vertex more, where the tangent planes of its vertices meet (half a cell beside it at most), and
        neighbors of the kind are joined: creases of the field come out as edges, which marching cubes chamfers.
        Manifold all the same; triangles may cross where the field turns within a cell.

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices in the field's unit, one for each crossed edge; triangles counter-clockwise seen from
        outside, manifold, the same whatever the number of threads.

    Raises
    ------
    InputError, MemoryBudgetError
        If an argument cannot be meant, the lattice would not fit into memory, or the seeds reach over a quarter of
        a million cells.
    ReconstructionError
        If the field does not take the isovalue in the box, or no seed leads to the surface.

    References
    ----------
    Lorensen and Cline (1987), Marching cubes: a high resolution 3D surface construction algorithm.
    Wyvill, McPheeters and Wyvill (1986), Data structure for soft objects: cells followed across crossed faces.
    Kobbelt, Botsch, Schwanecke and Seidel (2001), Feature sensitive surface extraction from volume data.
    """
    require_choice(method, METHODS, "method")
    require_one_column(field, "extract_isosurface")
    step, level = as_step(spacing), as_number(isovalue, "isovalue")
    if seeds is None:
        if within is not None or features:
            raise InputError("within, features: are for a surface that is continued from seeds; give seeds")
        box = as_bounds(field.bounds, 3) + np.stack([-step, step]) if bounds is None else as_bounds(bounds, 3)
        return build_mesh(*_march_box(field, Lattice.covering(box, step), level, method))
    if bounds is not None or method != "cubes":
        raise InputError("bounds, method: are for a whole lattice; with seeds leave them out, and give within")
    points = as_points(seeds, "seeds", dim=3, least=1)
    return build_mesh(
        *continue_from_seeds(field, step, points, level, within=within, sharpen=sharpen, features=features)
    )


def _march_box(field: Field, lattice: Lattice, level: float, method: str) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of the level on a whole lattice."""
    samples = sample_lattice(field, lattice)
    vertices, triangles = polygonize(samples, level, method)
    if not len(triangles):
        raise ReconstructionError(
            f"isovalue: {level:g} is not crossed by the field, whose values here run from {samples.min():.6g} to "
            f"{samples.max():.6g}; choose one between, other bounds, or a finer spacing"
        )
    return lattice.positions(vertices), triangles
