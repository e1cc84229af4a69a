"""Any field to triangles: on the whole lattice of a box, or continued from seeds where the surface is."""

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.coordinates import as_bounds, as_points
from o3dleaf.core.checks.scalars import as_number, require_choice
from o3dleaf.core.checks.voxels import as_step
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import IntArray, build_mesh
from o3dleaf.surface.isosurface.boxed_lattice import BoxedLattice
from o3dleaf.surface.isosurface.caps import close_faces
from o3dleaf.surface.isosurface.continuation import Within, continue_from_seeds
from o3dleaf.surface.isosurface.level_samples import sample_level
from o3dleaf.surface.isosurface.polygonize import METHODS, march


@checked
def extract_isosurface(
    field: Field,
    spacing: Positive | npt.ArrayLike,
    bounds: npt.ArrayLike | None = None,
    isovalue: Finite = 0.0,
    *,
    method: str = "cubes",
    closed: bool | None = None,
    seeds: npt.ArrayLike | None = None,
    within: Within | None = None,
    sharpen: bool = True,
    features: bool = False,
) -> o3d.geometry.TriangleMesh:
    r"""Return the surface {x : F(x) = isovalue} of a field as an Open3D triangle mesh.

    The field is sampled at the whole multiples of `spacing`, so that the surface does not depend on
    the box that it is cut from, and its vertices are where the linear interpolant along a lattice
    edge takes the isovalue: they lie within O(spacing^2) of the surface.

    What lies outside the field's own bounds is outside the solid {x : F(x) > isovalue}, whatever the field is there: a
    surface that they cut is closed by caps that lie on them. Neither the unit of length nor that of the values matters.

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
        Lower, then upper corner of the box, in the field's unit; left out, the field's own.
    isovalue : float
        The field is larger than this inside.
    method : {"cubes", "tetrahedra"}
        Marching cubes or marching tetrahedra (twice the triangles, free of
        self-intersection whatever the field).
    closed : bool, optional
        Whether a surface is closed where its box cuts it. By default it is where that is a face of the field's own
        bounds, and open where a face of `bounds` lies within them; that mesh then ends at whole steps. True closes it
        on all faces. False leaves it open on all, and takes the field beyond its bounds for what it says there.
    seeds : (n, 3) array_like, optional
        Points near the surface, such as the data, in the field's unit; the first in each block of 4 × 4 × 4 cells
        is moved onto the surface by Newton's method, :math:`x - F \nabla F / |\nabla F|^2`.
    within : float or callable, optional
        With seeds: cells whose center lies farther than this from all of them, or for whose centers (n, 3) the
        function returns False, are left out; the surface ends there, open. Left out, it is followed until it is
        closed, by the field's bounds too; those caps are beveled along the rim, by a step at most. `distance_mask`
        makes such a function of a cloud.
    sharpen : bool
        With seeds: evaluate the field once more at every vertex and move it along its edge to the zero of the parabola
        through the three values: off by O(spacing^3) at most where the field is smooth, instead of O(spacing^2).
    features : bool
        With seeds: evaluate the gradient at every vertex; where two in one cell are more than 26° apart, the cell
        gets one vertex more, where the tangent planes of its vertices meet (half a cell beside it at most) or, on the
        way there, the field is zero before, and neighbors of the kind are joined: creases of the field come out as
        edges, which marching cubes chamfers, and bends without a crease stay round.
        Manifold all the same; triangles may cross where the field turns within a cell.

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices in the field's unit, one for each crossed edge and each lattice point of a cap; triangles
        counter-clockwise seen from outside, manifold, the same whatever the number of threads.

    Raises
    ------
    InputError, MemoryBudgetError
        If an argument cannot be meant, the lattice would not fit into memory, or the seeds reach over a quarter of
        a million cells.
    ReconstructionError
        If the field does not take the isovalue in the box, or no seed leads to the surface.

    Notes
    -----
    What takes long is the field, not the triangles: a sample of a `PUInterpolant` is a sum over the 300 to 400 points
    of each of three or four balls, and takes as long as 30 samples do to be marched. It is what smooths, refines and
    differentiates; a mesh of the voxels as they are (`skimage.measure.marching_cubes`) has none of that. So it is asked
    in single precision first, where it was fitted to voxels of the same step by one product for all balls of a kind,
    and in double where that leaves open on which side a sample lies, and beside the surface: the mesh is the same.
    `seeds` ask near the surface alone.

    References
    ----------
    Lorensen and Cline (1987), Marching cubes: a high resolution 3D surface construction algorithm.
    Wyvill, McPheeters and Wyvill (1986), Data structure for soft objects: cells followed across crossed faces.
    Kobbelt, Botsch, Schwanecke and Seidel (2001), Feature sensitive surface extraction from volume data.
    """
    require_choice(method, METHODS, "method")
    require_one_column(field, "extract_isosurface")
    if np.ndim(field.bounds) != 2:
        raise InputError("field: has no bounds (2, 3); give it those of the box that it is known in")
    dimensions = np.shape(field.bounds)[-1]
    if dimensions != 3:
        raise InputError(f"field: is a function in {dimensions}-D; an isosurface is that of one in 3-D")
    step, level = as_step(spacing), as_number(isovalue, "isovalue")
    if seeds is None:
        if within is not None or features:
            raise InputError("within, features: are for a surface that is continued from seeds; give seeds")
        return build_mesh(*_march_box(field, _lattice(field, step, bounds, closed=closed), level, method))
    if bounds is not None or method != "cubes":
        raise InputError("bounds, method: are for a whole lattice; with seeds leave them out, and give within")
    points = as_points(seeds, "seeds", dim=3, least=1)
    return build_mesh(
        *continue_from_seeds(
            field,
            step,
            points,
            level,
            within=within,
            sharpen=sharpen,
            features=features,
            box=None if closed is False else field.bounds,
        )
    )


def _lattice(field: Field, step: FloatArray, bounds: npt.ArrayLike | None, *, closed: bool | None) -> BoxedLattice:
    """Return the lattice over what is asked of a field, cut where the surface is to be closed."""
    if bounds is None:
        box = as_bounds(field.bounds, 3)
        return BoxedLattice.covering(box, step, np.full((2, 3), closed is not False))
    box, own = as_bounds(bounds, 3), np.asarray(field.bounds, dtype=np.float64)
    if closed is False:
        return BoxedLattice.covering(box, step, np.zeros((2, 3), dtype=bool))
    common = np.stack([np.maximum(box[0], own[0]), np.minimum(box[1], own[1])])
    if np.any(common[1] < common[0]):
        raise InputError("bounds: lie outside the field's own; give a box that meets them, or closed=False")
    return BoxedLattice.covering(common, step, (common == own) | bool(closed))


def _march_box(field: Field, lattice: BoxedLattice, level: float, method: str) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of the level on a whole lattice."""
    kind = METHODS.index(method)
    samples = sample_level(field, lattice, level, kind)
    inside = samples > level
    low, high = float(samples.min()), float(samples.max())
    samples -= level
    crossings = march(samples, inside, kind)
    if not len(crossings.triangles):
        raise ReconstructionError(
            f"isovalue: {level:g} is not crossed by the field, whose values here run from {low:.6g} to "
            f"{high:.6g}; choose one between, other bounds, or a finer spacing"
        )
    corners, caps = close_faces(crossings, inside, kind, lattice.cut)
    vertices = lattice.positions(np.concatenate([crossings.positions(), corners]))
    return vertices, np.concatenate([crossings.triangles, caps])
