"""Arrays that are no mesh of triangles are refused as they stand, never read in another shape."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import UniqueRows, mesh_arrays

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TRIANGLES = np.array([[0, 1, 2], [0, 3, 1]])


@pytest.mark.parametrize("kind", [np.int32, np.int64, np.uint8, np.float64])
def test_arrays_and_meshes_of_both_kinds_are_the_same(kind):
    legacy = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(VERTICES), o3d.utility.Vector3iVector(TRIANGLES))
    for mesh in ((VERTICES, TRIANGLES.astype(kind)), legacy, o3d.t.geometry.TriangleMesh.from_legacy(legacy)):
        vertices, triangles = mesh_arrays(mesh)
        assert np.array_equal(vertices, VERTICES)
        assert np.array_equal(triangles, TRIANGLES)


def test_copies_are_returned():
    vertices, triangles = mesh_arrays((VERTICES, TRIANGLES))
    assert not np.shares_memory(vertices, VERTICES)
    assert not np.shares_memory(triangles, TRIANGLES)


@pytest.mark.parametrize("mesh", [o3d.geometry.TriangleMesh(), ([], []), (np.empty((0, 3)), np.empty((0, 3), int))])
def test_a_mesh_of_nothing_is_one(mesh):
    vertices, triangles = mesh_arrays(mesh)
    assert vertices.shape == triangles.shape == (0, 3)


@pytest.mark.parametrize(
    ("vertices", "triangles", "says"),
    [
        (VERTICES, [[0, 1, 2, 3]] * 3, "cut polygons"),
        (VERTICES, [0, 1, 2], "cut polygons"),
        (VERTICES, [[0, 1, 2], [0, 1]], "rows of one length"),
        (VERTICES, [[0, 1, 2.5]], "no whole numbers"),
        (VERTICES, [[0, 1, np.nan]], "no whole numbers"),
        (VERTICES, [["0", "1", "2"]], "no whole numbers"),
        (VERTICES, [[0, 1, 4]], "outside 0 to 3"),
        (VERTICES, [[0, 1, -1]], "outside 0 to 3"),
        (np.column_stack([VERTICES, np.ones(4)]), TRIANGLES, r"shape \(n, 3\)"),
        (np.column_stack([VERTICES, np.ones(4)])[:3], TRIANGLES, r"shape \(n, 3\)"),
        (VERTICES[:, :2], TRIANGLES, r"shape \(n, 3\)"),
        (1e200 * VERTICES, TRIANGLES, "1e-30 to 1e[+]30"),
        (1e-200 * VERTICES, TRIANGLES, "1e-30 to 1e[+]30"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices, triangles, says):
    with pytest.raises(InputError, match=says):
        mesh_arrays((vertices, triangles))


@pytest.mark.parametrize("count", [0, 1, 500])
@pytest.mark.parametrize("kind", [np.int64, np.float64])
@pytest.mark.parametrize("dimension", [2, 3])
def test_distinct_rows_are_numpys(count, kind, dimension):
    rows = np.random.default_rng(count).integers(-3, 4, (count, dimension)).astype(kind) / 2
    found = UniqueRows.of(rows)
    rising, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    assert np.array_equal(found.rows, rising)
    assert np.array_equal(found.first, first)
    assert np.array_equal(found.number, number.ravel())
