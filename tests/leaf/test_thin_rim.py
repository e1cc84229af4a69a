"""Beside a tapered rim, below hairs that lean over it: triangles do not cross, and only what would is lowered."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from leaf_fields import leaf_of
from leaf_fields import texture as texture_of
from o3dleaf import Margin, MultiscaleLeaf, ParametricBlade, mesh_report
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.leaf.fine_windows import extract_windows
from o3dleaf.leaf.meshing import MeshPlan
from o3dleaf.leaf.thin_rim import MAX_REACH, FlatMesh, NearMargin, lowered_vertices
from o3dleaf.output.report.summary import summarize, warnings_of
from o3dleaf.surface.mesh.crossings import find_crossings

PERIOD, STEP = 2.0, 0.1
HAIRS = [(0.0, 0.0, 1.0, -0.6), (0.55, 0.9, -0.9, 0.5), (-0.8, 0.4, 0.3, 1.1), (0.9, -0.5, -1.2, -0.2)]
"""Feet, and how far along and across their tips lean."""


def hairy(x, y, z):
    """A slab with hairs that lean, thinner than two steps."""
    hairs = [
        0.08 - np.hypot(*((p - a - s * z + 1) % PERIOD - 1 for p, a, s in ((x, u, su), (y, v, sv)))) / np.hypot(1, su)
        for u, v, su, sv in HAIRS
    ]
    return np.maximum(0.2 - np.abs(z + 0.15), np.minimum(np.maximum.reduce(hairs), 0.42 - z))


def notched():
    """A clover of three leaflets."""
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    radius = 2.6 * (0.55 + 0.45 * np.abs(np.cos(1.5 * angle)))
    return radius[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)]) + [10.0, 0.0]


def leaf_with(texture, radius):
    surface, ring = leaf_of(texture, bend=15.0)[0].blade.surface, notched()
    return MultiscaleLeaf(
        texture, blade=ParametricBlade(surface, Margin(ring, ring, spacing=0.25, unit="mm"), rim_radius=radius)
    )


@pytest.fixture(scope="module")
def hairs():
    return texture_of(hairy, half=0.55, n=29, per_ball=30)


@pytest.fixture(scope="module")
def leaf(hairs):
    return leaf_with(hairs, 0.3)


@pytest.fixture(scope="module")
def plan(leaf):
    return MeshPlan(leaf, STEP, closed=True)


def flat_of(plan):
    """The mesh in flat coordinates, nothing lowered."""
    arrays = Arrays(plan.assembly)
    plan.assembly.emit(arrays, lambda flat: flat)
    return FlatMesh(arrays.vertices, arrays.triangles, arrays.labels)


@pytest.mark.few(radius=1)
@pytest.mark.parametrize(("radius", "step"), [(0.1, 0.13), (0.3, STEP), (0.3, 0.06), (1.0, 0.08)])
def test_a_hairy_solid_with_a_tapered_rim_is_embedded(hairs, radius, step):
    leaf = leaf_with(hairs, radius)
    plan = MeshPlan(leaf, step, closed=True)
    flat = flat_of(plan)
    assert find_crossings(leaf.blade.lift(flat.flat), flat.triangles).any()
    report = mesh_report(plan.extract().mesh)
    assert report.watertight
    assert report.self_intersections == 0


def test_two_open_sheets_are_embedded(leaf):
    plan = MeshPlan(leaf, STEP)
    assert len(plan.lowered.flat) > 0
    assert mesh_report(plan.extract().mesh).self_intersections == 0


def test_only_vertices_near_a_crossing_are_lowered_and_the_edge_is_none_of_them(leaf, plan):
    """All others keep their bits."""
    flat, made = flat_of(plan), plan.extract()
    before, (after, triangles) = leaf.blade.lift(flat.flat), mesh_arrays(made.mesh)
    moved = np.any(before != after, axis=1)
    assert moved.sum() == len(plan.lowered.flat)
    assert not moved[triangles[made.labels == RIM]].any()
    crossing = flat.flat[triangles[find_crossings(before, triangles)].ravel()]
    away, _ = cKDTree(crossing[:, :2]).query(flat.flat[moved, :2])
    assert away.max() <= 2 * MAX_REACH * plan.spacing[0]
    assert moved.mean() < 0.5
    lowered = plan.lowered.apply(flat.flat)
    assert np.array_equal(lowered[:, :2], flat.flat[:, :2])
    share = lowered[moved, 2] / flat.flat[moved, 2]
    assert share.min() >= leaf.blade.rim.least - 1e-12
    assert share.max() < 1
    assert plan.lowered.most == np.linalg.norm(after - before, axis=1).max()


def test_no_hair_no_vertex_is_lowered():
    wavy = texture_of(lambda x, y, z: 0.2 + 0.05 * np.cos(np.pi * x) + 0.04 * np.sin(np.pi * y) - np.abs(z))
    for closed in (False, True):
        plan = MeshPlan(leaf_with(wavy, 0.3), STEP, closed=closed)
        assert len(plan.lowered.flat) == 0
        assert plan.lowered.warnings == []


def test_what_crosses_however_thin_the_rim_is_stays_as_it_is(leaf, plan):
    """A triangle that passes through another one, away from what is lowered."""
    mesh = flat_of(plan)
    thickness = leaf.blade.rim.values(mesh.flat[:, :2])
    near = np.flatnonzero((thickness > 0.8) & (thickness < 1))
    away, _ = cKDTree(plan.lowered.flat[:, :2]).query(mesh.flat[near, :2])
    assert away.max() > STEP
    corner = [*mesh.flat[near[away.argmax()], :2], 0.6]
    pair = corner + [0.02, 0.02, 0.1] * np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.3, 0.2, 1], [0.2, 0.3, 1]]
    )
    triangles = np.vstack([mesh.triangles, len(mesh.flat) + np.arange(6).reshape(2, 3)])
    both = FlatMesh(np.vstack([mesh.flat, pair]), triangles, np.append(mesh.labels, [0, 0]))
    assert find_crossings(leaf.blade.lift(both.flat), triangles)[-2:].all()
    lowered = lowered_vertices(leaf.blade, both, max(plan.spacing[:2])).flat
    assert sorted(map(tuple, lowered)) == sorted(map(tuple, plan.lowered.flat))


def test_the_sink_keeps_what_all_of_the_mesh_has_near_the_margin(leaf, plan):
    """Rows of tiles one after the other, triangles before the vertices of the next row."""
    band = type(leaf.blade.rim)(leaf.blade.outline.polygon, 0.45)
    sink = NearMargin(plan.vertices, band)
    plan.assembly.emit(sink, lambda flat: flat, batch_size=100)
    found, whole = sink.mesh(), flat_of(plan)
    expected = whole.part(band.values(whole.flat[:, :2]) < 1)
    assert 0 < len(expected.triangles) < len(whole.triangles)
    assert np.array_equal(found.flat, expected.flat)
    for part, other in ((found.triangles, expected.triangles), (found.labels, expected.labels)):
        assert sorted(map(tuple, part.reshape(len(part), -1))) == sorted(map(tuple, other.reshape(len(other), -1)))


def test_what_is_looked_at_reaches_as_far_as_vertices_can_be_lowered(leaf, plan):
    """The whole mesh has the same vertices lowered as its part near the margin."""
    whole = lowered_vertices(leaf.blade, flat_of(plan), max(plan.spacing[:2]))
    assert sorted(map(tuple, whole.flat)) == sorted(map(tuple, plan.lowered.flat))


def test_the_file_is_the_mesh_in_memory(plan, tmp_path):
    plan.write(tmp_path / "leaf.ply")
    read, made = read_mesh(tmp_path / "leaf.ply").mesh, plan.extract().mesh
    for one, other in zip(mesh_arrays(read), mesh_arrays(made), strict=True):
        assert np.array_equal(one, other)


def test_a_mesh_with_windows_is_embedded_too(leaf):
    mesh = extract_windows(leaf, STEP, [([[9.8, -0.3], [10.2, 0.3]], STEP / 2)], closed=True).mesh
    report = mesh_report(mesh)
    assert report.watertight
    assert report.self_intersections == 0


@pytest.mark.parametrize("closed", [True, False])
def test_a_region_whose_sides_pass_through_the_rim_is_embedded(leaf, closed):
    """Its sides are as thick as the leaf is there, not as thin as the edge."""
    report = mesh_report(MeshPlan(leaf, 0.11, [[10.0, 0.2], [11.4, 1.9]], closed=closed).extract().mesh)
    assert report.components == (1 if closed else 2)
    assert report.self_intersections == 0


@pytest.mark.slow
def test_a_remeshed_solid_is_embedded(leaf):
    """Its rim is thinner than its triangles are long, and hairs lean over it."""
    report = mesh_report(leaf.extract_mesh(0.13, [[9.65, 1.0], [10.35, 2.3]], closed=True, remesh=0.13))
    assert report.watertight
    assert (report.components, report.self_intersections) == (1, 0)


def test_how_many_are_lowered_is_told_with_their_place(leaf, plan):
    summary = summarize(leaf.blade, plan.extract().mesh, {}, leaf=leaf, surface=plan)
    told = summary["surface"]["lowered_at_the_rim"]
    assert told["vertices"] == len(plan.lowered.flat)
    (warning,) = plan.lowered.warnings
    assert warning in warnings_of(summary)
    assert warning.startswith(f"{told['vertices']:,} vertices beside the rim lie up to ")
    lifted = leaf.blade.lift(plan.lowered.flat)
    for place in plan.lowered.places:
        assert np.linalg.norm(lifted - place.center, axis=1).min() < plan.spacing[0]
