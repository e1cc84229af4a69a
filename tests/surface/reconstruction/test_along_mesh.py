"""Data support a surface along it: not a flap that curls back over them, nor what runs beside another sheet's."""

import numpy as np
import pytest

from mesh_fields import joined
from o3dleaf import OrientedCloud, find_inverted_regions, mesh_report, trim_to_data
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.reconstruction.along_mesh import MeshNearData, VertexNeighbors, distance_along
from tolerances import FLAP

SPACING = 0.05
STEP = 0.03


def ribbon(profile, *, closed=False):
    """Return the mesh that a curve (n, 2) in x and z, open or closed, sweeps along 0 <= y <= 2."""
    y = np.arange(0, 2 + STEP / 2, STEP)
    vertices = np.column_stack(
        [np.repeat(profile[:, 0], len(y)), np.tile(y, len(profile)), np.repeat(profile[:, 1], len(y))]
    )
    number = np.arange(len(vertices)).reshape(len(profile), len(y))
    number = np.vstack([number, number[:1]]) if closed else number
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def curl(height):
    """Return a curve that goes from x = 0 to 1, turns over, and runs back to x = 0.5, `height` above itself."""
    flat = np.arange(0, 1, STEP)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 12) if height else []
    bend = np.column_stack([1 + height / 2 * np.cos(turn), height / 2 * (1 + np.sin(turn))])
    back = np.arange(1 - STEP, 0.5, -STEP)
    return np.vstack([np.column_stack([flat, 0 * flat]), bend, np.column_stack([back, 0 * back + height])])


def sheet(low, high, height=0.0, seed=3):
    """Return random points of a flat sheet, SPACING apart, with normals upward."""
    count = round((high - low) * 2 / SPACING**2)
    xy = np.random.default_rng(seed).uniform([low, 0], [high, 2], size=(count, 2))
    return np.column_stack([xy, np.full(count, height)]), np.tile([0.0, 0, 1], (count, 1))


@pytest.mark.parametrize(("height", "facing"), [(0.8, True), (2.0, True), (2.0, False)])
def test_a_flap_that_curls_back_over_the_data_goes(height, facing):
    """What is more than three spacings along the mesh from data goes, though all of it is within three in space."""
    points, normals = sheet(0, 1)
    data = OrientedCloud.of(points, normals if facing else None, spacing=SPACING)
    mesh = ribbon(curl(height * SPACING))
    cut, _ = mesh_arrays(trim_to_data(mesh, data, noise=0.0))
    inner = cut[(cut[:, 1] > 0.2) & (cut[:, 1] < 1.8)]
    # Half a spacing past the data the surface has only begun to turn.
    assert inner[:, 0].max() > 1 - FLAP * SPACING
    flap = inner[inner[:, 2] > 0.9 * height * SPACING]
    assert len(flap) == 0 or flap[:, 0].min() > 1 - FLAP * SPACING
    assert mesh_report(trim_to_data(mesh, data, noise=0.0)).components == 1


def test_a_flap_nearer_than_a_spacing_cannot_be_told_without_normals():
    points, normals = sheet(0, 1)
    mesh = ribbon(curl(0.5 * SPACING))
    clouds = [OrientedCloud.of(points, some, spacing=SPACING) for some in (normals, None)]
    areas = [mesh_report(trim_to_data(mesh, cloud, noise=0.0)).area for cloud in clouds]
    assert areas[0] < 2.1 + 2 * FLAP * SPACING < 2.9 < areas[1]


def test_a_sheet_ends_at_its_own_data_and_not_at_those_of_the_sheet_below():
    below, facing = sheet(0, 2)
    above, same = sheet(0, 1, 2 * SPACING, seed=4)
    flat = np.arange(-0.3, 2.3, STEP)
    mesh = joined(ribbon(np.column_stack([flat, 0 * flat])), ribbon(np.column_stack([flat, 0 * flat + 2 * SPACING])))
    data = OrientedCloud.of(np.vstack([below, above]), np.vstack([facing, same]), spacing=SPACING)
    cut, _ = mesh_arrays(trim_to_data(mesh, data, noise=0.0))
    middle = cut[np.abs(cut[:, 1] - 1) < 0.8]
    for height, end in ((0, 2), (2 * SPACING, 1)):
        rim = middle[np.abs(middle[:, 2] - height) < 1e-9, 0].max()
        assert abs(rim - end) < FLAP * SPACING


@pytest.mark.parametrize("thickness", [0.3, 3.0])
def test_a_two_sided_sheet_without_data_on_its_edge_stays_closed(thickness):
    """Its rim faces away from neither side's data by more than 90°."""
    height = thickness * SPACING
    turn, x = np.linspace(-np.pi / 2, np.pi / 2, 12), np.arange(STEP, 1, STEP)
    bend = height / 2 * np.column_stack([np.cos(turn), np.sin(turn)])
    halves = np.vstack([np.column_stack([x, 0 * x]), bend + [1, height / 2]])
    mesh = ribbon(np.vstack([halves, [1, height] - halves]), closed=True)
    top, up = sheet(0, 1, height)
    bottom, _ = sheet(0, 1, 0.0, seed=5)
    data = OrientedCloud.of(np.vstack([top, bottom]), np.vstack([up, -up]), spacing=SPACING)
    assert not find_inverted_regions((mesh[0], mesh[1][:, ::-1]), data).any()
    report = mesh_report(trim_to_data((mesh[0], mesh[1][:, ::-1]), data, noise=0.0))
    assert report.boundary_loops == 2


def test_distances_go_along_the_mesh():
    """From one row of data over a flat mesh: Euclid's; back over it on the flap, four spacings and more."""
    vertices, triangles = ribbon(curl(2 * SPACING))
    row = np.column_stack([np.full(41, 0.9), np.linspace(0, 2, 41), np.zeros(41)])
    data = OrientedCloud.of(row, spacing=SPACING)
    mesh = MeshNearData.of(vertices, triangles, data)
    found = distance_along(mesh, data, 0.0, 20.0)
    flat = vertices[:, 2] == 0
    np.testing.assert_allclose(found[flat], mesh.distance[flat] / SPACING, rtol=1e-12)
    above = (vertices[:, 2] == 2 * SPACING) & (np.abs(vertices[:, 0] - 0.9) < SPACING)
    assert mesh.distance[above].max() < 3 * SPACING
    # Euclid's again, from where the sheet has turned; it has come at least two spacings out and two back up.
    assert found[above].min() > 2
    assert distance_along(mesh, data, 0.0, 3.0).max() == 3


def test_the_vertices_beside_each():
    triangles = ribbon(curl(2 * SPACING))[1]
    beside = VertexNeighbors.of(triangles, triangles.max() + 1)
    for v in (0, 500, triangles.max()):
        expected = np.setdiff1d(triangles[(triangles == v).any(axis=1)], [v])
        assert np.array_equal(np.sort(beside.neighbors[beside.begin[v] : beside.begin[v + 1]]), expected)


def test_normals_that_are_not_the_points():
    points, normals = sheet(0, 1)
    with pytest.raises(InputError, match="normals"):
        OrientedCloud.of(points, normals[1:])
    with pytest.raises(InputError, match="normals"):
        find_inverted_regions(ribbon(curl(0.1)), points)
