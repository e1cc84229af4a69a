"""Any Field to triangles: sample a lattice over a box and polygonise it."""

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks import as_bounds, as_step, require_choice
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.field import Field
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.core.parallel import Progress
from o3dleaf.surface.isosurface.polygonise import METHODS, polygonise


def extract_isosurface(
    field: Field,
    spacing: float | npt.ArrayLike,
    bounds: npt.ArrayLike | None = None,
    isovalue: float = 0.0,
    *,
    method: str = "cubes",
    progress: Progress | None = None,
) -> o3d.geometry.TriangleMesh:
    r"""Return the surface {x : F(x) = isovalue} of a field as an Open3D triangle mesh.

    The field is sampled at the whole multiples of `spacing`, so that the surface does not depend on
    the box that it is cut from, and its vertices are where the linear interpolant along a lattice
    edge takes the isovalue: they lie within O(spacing^2) of the surface.

    Parameters
    ----------
    field : Field
        Larger inside, of three dimensions.
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
    progress : callable, optional
        ``progress(done, total)`` in lattice points.

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices in the field's unit; triangles counter-clockwise seen from outside.

    Raises
    ------
    InputError, MemoryBudgetError
        If `spacing` or `bounds` cannot be meant, or the lattice would not fit into memory.
    ReconstructionError
        If the field does not take the isovalue in the box.
    """
    require_choice(method, METHODS, "method")
    step = as_step(spacing)
    box = as_bounds(field.bounds, 3) + np.stack([-step, step]) if bounds is None else as_bounds(bounds, 3)
    lattice = Lattice.covering(box, step)
    samples = sample_lattice(field, lattice, progress=progress)
    vertices, triangles = polygonise(samples, isovalue, method)
    if not len(triangles):
        raise ReconstructionError(
            f"isovalue: {isovalue:g} is not crossed by the field, whose values here run from {samples.min():.6g} to "
            f"{samples.max():.6g}; choose one between, other bounds, or a finer spacing"
        )
    return build_mesh(lattice.positions(vertices), triangles)
