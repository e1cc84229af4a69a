"""A leaf with a tip, a notch and a hole: meshes cut along its margin, in memory and in files, and distances to it."""

import numpy as np
import pytest
import shapely

from leaf_fields import texture as texture_of
from margin_fields import cut_leaf
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays, triangle_areas
from o3dleaf.io.labelled_mesh import ABAXIAL, ADAXIAL, RIM
from o3dleaf.io.triangle_mesh import write_mesh
from o3dleaf.leaf.fine_windows import extract_windows
from o3dleaf.leaf.meshing import MeshPlan
from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.mesh.topology import EdgeTable
from tolerances import CUT_AREA, ON_MARGIN, RIM_DISTANCE

HALF = 0.2037
REGION = [[4.03, -1.77], [9.43, 1.9]]
"""Through the hole and the notch."""


@pytest.fixture(scope="module")
def slab():
    """A flat leaf of one thickness."""
    return cut_leaf(texture_of(lambda x, y, z: HALF**2 - z**2 + 0 * x * y))


@pytest.fixture(scope="module")
def leaf():
    """Ridges on a bent leaf."""
    return cut_leaf(
        texture_of(lambda x, y, z: HALF + 0.05 * np.cos(np.pi * x) + 0.03 * np.sin(np.pi * y) - np.abs(z)), bend=15.0
    )


def corners(mesh, *labels):
    """The triangles of some labels as bits, each from its least corner on."""
    vertices, triangles = mesh_arrays(mesh.mesh)
    rows = [[v.tobytes() for v in triangle] for triangle in vertices[triangles[np.isin(mesh.labels, labels)]]]
    return sorted(tuple(row[(k := row.index(min(row))) :] + row[:k]) for row in rows)


@pytest.mark.parametrize(
    "how", [{}, {"region": REGION}, {"method": "tetrahedra"}, {"simplify": 0.5}, {"remesh_tile": 0.3}]
)
def test_the_open_mesh_is_the_closed_one_without_its_wall(leaf, how):
    open_plan, closed_plan = (MeshPlan(leaf, 0.2, closed=closed, **how) for closed in (False, True))
    sheets, solid = open_plan.extract(), closed_plan.extract()
    assert corners(sheets, ADAXIAL, ABAXIAL) == corners(solid, ADAXIAL, ABAXIAL)
    assert set(np.unique(sheets.labels)) == {ADAXIAL, ABAXIAL}
    assert (len(sheets.mesh.vertices), len(sheets.mesh.triangles)) == (open_plan.vertices, open_plan.triangles)
    report, whole = mesh_report(sheets.mesh), mesh_report(solid.mesh)
    assert report.manifold
    assert report.oriented
    assert (report.components, report.genus) == (2, 0)
    assert whole.manifold
    assert (whole.components, whole.boundary_edges, whole.genus) == (1, 0, report.boundary_loops // 2 - 1)
    assert report.boundary_loops == 4
    assert open_plan.fragments.pieces == 2 * closed_plan.fragments.pieces


def test_the_area_of_a_sheet_does_not_depend_on_the_step(slab):
    expected = slab.blade.outline.area
    for spacing in (0.4, 0.25, 0.15):
        for closed in (False, True):
            mesh = MeshPlan(slab, spacing, closed=closed).extract()
            areas = triangle_areas(*mesh_arrays(mesh.mesh))
            for label in (ADAXIAL, ABAXIAL):
                assert areas[mesh.labels == label].sum() == pytest.approx(expected, rel=CUT_AREA)


def test_open_edges_lie_on_the_margin(slab):
    """But at corners of the outline, which are cut off within a step."""
    margin, step = slab.blade.outline.polygon, 0.1
    vertices, triangles = mesh_arrays(MeshPlan(slab, step).extract().mesh)
    edges = EdgeTable.of(triangles)
    rim = vertices[np.unique(edges.ends[edges.count == 1]), :2]
    away = shapely.distance(margin.boundary, shapely.points(rim))
    assert np.quantile(away, 0.99) < ON_MARGIN[0] * step
    assert away.max() < ON_MARGIN[1] * step
    # And all of the margin has an edge beside it.
    along = shapely.get_coordinates(margin.boundary.interpolate(np.linspace(0, 1, 1500), normalized=True))
    gap = np.linalg.norm(along[:, np.newaxis] - rim, axis=2).min(axis=1)
    assert np.mean(gap < step) > 0.99


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_what_was_counted_is_written(leaf, tmp_path, suffix):
    plan, path = MeshPlan(leaf, 0.25), tmp_path / f"leaf{suffix}"
    said = plan.bytes(path)
    plan.write(path)
    size = path.stat().st_size
    assert 0.6 * said < size <= said if suffix == ".obj" else size == said
    made = plan.extract()
    write_mesh(made, tmp_path / f"again{suffix}", plan._comments)
    assert (tmp_path / f"again{suffix}").read_bytes() == path.read_bytes()
    both = plan.write_and_extract(tmp_path / f"both{suffix}")
    assert (tmp_path / f"both{suffix}").read_bytes() == path.read_bytes()
    assert all(map(np.array_equal, mesh_arrays(both.mesh), mesh_arrays(made.mesh)))
    assert np.array_equal(both.labels, made.labels)
    assert both.unit == made.unit


@pytest.mark.parametrize("closed", [False, True])
def test_windows_are_set_in_beside_a_hole_and_refused_over_its_rim(leaf, closed):
    found = extract_windows(leaf, 0.25, [([[10.6, -0.7], [12.1, 0.7]], 0.125)], closed=closed)
    report = mesh_report(found.mesh)
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 4))
    with pytest.raises(InputError, match="reaches the rim"):
        extract_windows(leaf, 0.25, [([[6.5, -0.2], [8.0, 0.7]], 0.125)], closed=closed)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_remeshing_keeps_the_hole(leaf, closed):
    mesh = MeshPlan(leaf, 0.2, REGION, closed=closed).extract(remesh=0.2)
    report = mesh_report(mesh.mesh)
    assert report.manifold
    assert report.self_intersections == 0
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 4))
    assert report.genus == (1 if closed else 0)
    assert set(np.unique(mesh.labels)) == ({ADAXIAL, ABAXIAL, RIM} if closed else {ADAXIAL, ABAXIAL})


@pytest.mark.parametrize("closed", [False, True])
def test_the_distance_to_a_slab_with_a_hole_is_that_to_a_prism(slab, closed):
    rng, margin = np.random.default_rng(0), slab.blade.outline.polygon
    hole = np.array(margin.interiors[0].coords)
    beside = hole[rng.integers(0, len(hole), 1500)] + rng.normal(0, 0.2, (1500, 2))
    anywhere = rng.uniform([0, -3], [20, 3], (1500, 2))
    x = np.column_stack([np.concatenate([beside, anywhere]), rng.normal(0, 0.3, 3000)])
    inside = shapely.contains_xy(margin, *x[:, :2].T)
    away = shapely.distance(margin.boundary, shapely.points(x[:, :2])) * np.where(inside, -1, 1)
    q = np.column_stack([away, np.abs(x[:, 2]) - HALF])
    expected = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    assert np.abs(slab.signed_distance(x, closed=closed) - expected).max() <= RIM_DISTANCE
