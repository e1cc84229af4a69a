"""Facets: areas that add up, inclinations that turn with the leaf, curvature of a sphere, sides as the labels say."""

import numpy as np
import open3d as o3d
import pytest

from leaf_fields import leaf_of, texture
from mesh_fields import sphere
from o3dleaf.commands.export import ExportJob
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays, triangle_areas
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.triangle_mesh import write_mesh
from o3dleaf.output.export import facets as module
from o3dleaf.output.export.facets import COLUMNS, export_facets, facets_of
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import FACET_CURVATURE, FACET_OF_SPHERE, ROUNDING

RADIUS = 0.8
CENTER = np.array([0.013, -0.021, 0.007])


@pytest.fixture(scope="module")
def ball():
    return o3d.geometry.TriangleMesh.create_sphere(RADIUS, 40).translate(CENTER)


@pytest.fixture(scope="module")
def facets(ball):
    return facets_of(ball, unit="mm")


def test_a_sphere_is_seen_as_one(ball, facets):
    assert facets.areas.sum() == pytest.approx(triangle_areas(*mesh_arrays(ball)).sum(), rel=ROUNDING)
    outward = (facets.centroids - CENTER) / np.linalg.norm(facets.centroids - CENTER, axis=1)[:, np.newaxis]
    assert np.einsum("ij,ij->i", outward, facets.normals).min() > 1 - FACET_OF_SPHERE
    assert np.abs(np.cos(np.radians(facets.inclinations)) - facets.normals[:, 2]).max() < ROUNDING
    # Its triangles are slivers at the poles.
    girdle = np.abs(facets.centroids[:, 2] - CENTER[2]) < 0.8 * RADIUS
    assert np.abs(facets.curvatures[girdle] * RADIUS - 1).max() < FACET_CURVATURE
    inside_out = build_mesh(np.asarray(ball.vertices), np.asarray(ball.triangles)[:, ::-1])
    assert np.abs(facets_of(inside_out).curvatures[girdle] * RADIUS + 1).max() < FACET_CURVATURE


def test_a_field_gives_its_own_curvature():
    """Of a cylinder of radius R + h on a strip bent about R: half its inverse, to the last triangle."""
    leaf = leaf_of(texture(lambda x, y, z: 0.3**2 - z**2 + 0.0 * x), bend=30.0)[0]
    mesh = leaf.plan_mesh(0.5, ((5.0, -1.0), (9.0, 1.0)), closed=True).extract()
    found = facets_of(mesh, field=leaf)
    top = found.sides == "adaxial"
    distance = np.hypot(found.centroids[top, 0], found.centroids[top, 2] + 30.0)
    assert np.abs(2 * found.curvatures[top] * distance - 1).max() < FACET_CURVATURE


def test_turned_with_its_vertical_a_leaf_inclines_as_before(ball, facets):
    turn = o3d.geometry.get_rotation_matrix_from_xyz((0.4, -1.1, 2.0))
    turned = build_mesh(np.asarray(ball.vertices) @ turn.T, np.asarray(ball.triangles))
    again = facets_of(turned, vertical=7e-300 * turn[:, 2])
    assert np.abs(again.inclinations - facets.inclinations).max() < 1e3 * ROUNDING * 180
    plane = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-300]]), [[0, 1, 2], [0, 2, 1]]
    assert facets_of(plane).inclinations.tolist() == [0.0, 180.0]
    assert facets_of(plane, vertical=(1, 0, 0)).inclinations.tolist() == [90.0, 90.0]


def test_a_triangle_without_area_has_no_curvature():
    found = facets_of(([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0.0]], [[0, 1, 2], [0, 1, 3]]))
    assert found.areas.tolist() == [0.0, 0.5]
    assert found.curvatures.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("labelled", [False, True])
def test_files_say_the_same_in_another_unit(ball, tmp_path, labelled, monkeypatch):
    monkeypatch.setattr(module, "ROWS", 1000)
    numbers = np.arange(len(ball.triangles)).astype(np.uint8) % 3 if labelled else None
    found = facets_of(LabelledMesh(ball, numbers, unit="mm"))
    export_facets(found, tmp_path / "a.csv", to_unit="m")
    export_facets(found, tmp_path / "a.vtp", to_unit="m")
    lines = (tmp_path / "a.csv").read_text(encoding="ascii").splitlines()
    assert lines[0] == "# o3dleaf facets, unit m, inclination in degrees to 0 0 1"
    assert tuple(lines[1].split(",")) == COLUMNS
    rows = [line.split(",") for line in lines[2:]]
    assert [row[-1] for row in rows] == (found.sides.tolist())
    assert set(found.sides) == ({"adaxial", "abaxial", "rim"} if labelled else {"unknown"})
    table = np.array([row[:-1] for row in rows], dtype=np.float64)
    assert np.array_equal(table[:, :3], found.centroids * 1e-3)
    assert np.array_equal(table[:, 3], found.areas * 1e-6)
    assert np.array_equal(table[:, 4:7], found.normals)
    assert np.array_equal(table[:, 7], found.inclinations)
    assert np.array_equal(table[:, 8], found.curvatures / 1e-3)
    data = (tmp_path / "a.vtp").read_bytes()
    start = data.index(b'<AppendedData encoding="raw">\n_') + 31
    for name, column in (("inclination", 7), ("curvature", 8)):
        offset = int(data.split(f'Name="{name}" format="appended" offset="'.encode())[1].split(b'"')[0])
        assert np.array_equal(np.frombuffer(data, "<f8", len(rows), start + offset + 8), table[:, column])
    assert (b'Name="label"' in data) == labelled


def test_the_command_writes_them(ball, tmp_path):
    write_mesh(LabelledMesh(ball, np.zeros(len(ball.triangles), np.uint8), unit="mm"), tmp_path / "a.ply")
    run = ExportJob(
        tmp_path / "a.ply", tmp_path / "a.csv", consumer="retention", vertical=(0, 1, 0), origin=(1, 0, 0), quiet=True
    )
    assert run.run() == f"{len(ball.triangles):,} facets, adaxial"
    wanted = facets_of(ball, vertical=(0, 1, 0))
    table = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=2, usecols=range(9))
    assert np.array_equal(table[:, 0], wanted.centroids[:, 0] - 1)
    assert np.array_equal(table[:, 7], wanted.inclinations)
    with pytest.raises(InputError, match="no length"):
        facets_of(ball, vertical=(0, 0, 0))
    assert len(facets_of(extract_isosurface(sphere(), 0.3)).areas) > 100
