"""The blade on its own surface: lift and flatten are inverse, gradients are limits, solids are watertight."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

import o3dleaf as o3l
from chart_fields import CROSSED, LENGTH, WIDTH, curled, inner_places, looped, surface_of, twisted
from leaf_fields import texture
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.leaf.chart.petiole import Petiole
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.output.report.summary import summarize, warnings_of
from tolerances import BESIDE_FOOT, CHART_FOOT, CHART_SLOPE, DIFFERENCED_GRADIENT, DIFFERENCED_JACOBIAN, SIGNED_VS_FOOT

HALF = 0.5
STEP = 1e-5


class Box:
    """A rectangle of the chart with round corners as an outline."""

    def __init__(self, end=LENGTH - 0.5):
        whole = shapely.box(0.5, 0.5 - WIDTH / 2, end, WIDTH / 2 - 0.5)
        self.polygon = self.rounded = whole.buffer(-1.0).buffer(1.0, quad_segs=32)
        self.bounds = np.array(self.polygon.bounds).reshape(2, 2)
        self.area = self.polygon.area

    def contains(self, points):
        return shapely.intersects_xy(self.polygon, *np.reshape(points, (-1, 2)).T)


@pytest.fixture(scope="module", params=[curled, twisted], ids=["curled", "twisted"])
def surface(request):
    return surface_of(request.param)


@pytest.fixture(scope="module", params=[None, 1.5], ids=["even", "tapered"])
def blade(request, surface):
    return ParametricBlade(surface, Box(), rim_radius=request.param)


@pytest.fixture(scope="module")
def even(surface):
    return ParametricBlade(surface, Box(), notes=("one thing",))


@pytest.fixture(scope="module")
def leaf(even):
    # Two waves, thin enough for the curl: a sheet whose sides are smooth.
    def wavy(x, y, z):
        return 0.2037 + 0.03 * np.sin(np.pi * x) + 0.03 * np.sin(np.pi * y) - z * z / 0.2037

    return o3l.MultiscaleLeaf(texture(wavy), blade=even)


@pytest.fixture(scope="module")
def flat():
    rng = np.random.default_rng(2)
    return np.column_stack([inner_places(1500, inset=0.6), rng.uniform(-HALF, HALF, 1500)])


def test_flatten_undoes_lift(blade, flat):
    assert np.abs(blade.flatten(blade.lift(flat)) - flat).max() <= CHART_FOOT


def test_no_foot_lies_on_what_continues_the_blade_through_itself():
    """Of a blade that ends just above itself no point is nearer to some of it than to the place of its foot."""
    blade, rng = ParametricBlade(surface_of(looped), Box(CROSSED - 0.06)), np.random.default_rng(8)
    points = rng.uniform([5.5, -3, -0.3], [6.5, 3, 0.3], (4000, 3))
    there = np.stack(np.meshgrid(np.arange(0.5, CROSSED - 0.06, 0.02), np.arange(-4, 4, 0.04)), -1).reshape(-1, 2)
    nearest = cKDTree(blade.surface.jet(there, 0)[0]).query(points)[0]
    feet = blade.flatten(points)
    beside = shapely.distance(blade.outline.polygon, shapely.points(feet[:, :2]))
    assert np.any(beside > 0)
    assert np.all(np.hypot(feet[:, 2], beside) <= nearest + BESIDE_FOOT)


def test_the_jacobian_is_the_limit_of_difference_quotients(blade, flat):
    lifted = blade.lift_with_jacobian(flat)
    assert np.abs(lifted.world - blade.lift(flat)).max() <= 1e-12
    for axis in range(3):
        shift = STEP * np.eye(3)[axis]
        difference = (blade.lift(flat + shift) - blade.lift(flat - shift)) / (2 * STEP)
        # Where the taper meets full thickness its derivative has a kink.
        assert np.quantile(np.abs(lifted.columns[:, axis] - difference), 0.99) <= DIFFERENCED_JACOBIAN, SIGNED_VS_FOOT


def test_pulled_back_gradients_are_those_of_the_world(blade, flat):
    world = blade.lift(flat)
    inner = np.column_stack([np.cos(flat[:, 0]), np.ones(len(flat)), 2 * flat[:, 2]])
    pulled = blade.pull_back(flat, inner, world)

    def value(x):
        z = blade.flatten(x)
        return np.sin(z[:, 0]) + z[:, 1] + z[:, 2] ** 2

    for axis in range(3):
        shift = STEP * np.eye(3)[axis]
        difference = (value(world + shift) - value(world - shift)) / (2 * STEP)
        assert np.quantile(np.abs(pulled[:, axis] - difference), 0.99) <= DIFFERENCED_GRADIENT


def test_what_lies_on_a_cylinder_is_not_distorted():
    cylinder = ParametricBlade(surface_of(curled), Box())
    distortion = cylinder.distortion()
    for measure in (distortion.along, distortion.across, distortion.thickness, distortion.area):
        assert np.quantile(np.abs(measure - 1), 0.99) <= CHART_SLOPE
    assert np.quantile(np.abs(distortion.shear), 0.99) <= CHART_SLOPE


def test_a_taper_falls_from_one_to_the_rim(surface):
    tapered = ParametricBlade(surface, Box(), rim_radius=1.5)
    v = np.linspace(0, tapered.outline.bounds[1, 1], 60)
    flat = np.column_stack([np.full(60, LENGTH / 2), v, np.full(60, 0.2)])
    middle = tapered.surface.jet(flat[:, :2], 0)[0]
    heights = np.linalg.norm(tapered.lift(flat) - middle, axis=1)
    depth = WIDTH / 2 - 0.5 - v
    assert np.allclose(heights[depth >= 1.5], 0.2)
    assert np.all(np.diff(heights[depth < 1.5]) < 0)
    assert 0 < heights[-1] < 0.1
    with pytest.raises(InputError, match="rim_radius"):
        ParametricBlade(surface, Box(), rim_radius=0.0)


def test_the_sheet_ends_on_the_outline_and_has_its_area(even):
    areas = []
    for spacing in (1.0, 0.25):
        mesh = even.extract_mesh(spacing)
        report = o3l.mesh_report(mesh)
        assert report.components == 1
        areas.append(report.area)
    assert areas[0] == pytest.approx(areas[1], rel=0.01)
    assert areas[1] == pytest.approx(float(even.distortion().area.mean() * even.outline.area), rel=0.005)
    with pytest.raises(ReconstructionError):
        even.extract_mesh(0.5, [[1000, 1000], [1001, 1001]])


def test_g_is_the_texture_at_flat_coordinates_and_its_gradient_a_limit(leaf, flat):
    inner = flat[np.abs(flat[:, 2]) < 0.4]
    world = leaf.blade.lift(inner)
    assert np.abs(leaf(world) - leaf.texture(inner)).max() <= 1e-8
    gradient = leaf.gradient(world)
    for axis in range(3):
        shift = STEP * np.eye(3)[axis]
        difference = (leaf(world + shift) - leaf(world - shift)) / (2 * STEP)
        assert np.quantile(np.abs(gradient[:, axis] - difference), 0.99) <= DIFFERENCED_GRADIENT


def test_closed_it_is_one_watertight_solid(leaf):
    report = o3l.mesh_report(leaf.extract_mesh(0.25, closed=True))
    assert report.watertight
    assert report.components == 1
    sheets = o3l.mesh_report(leaf.extract_mesh(0.25))
    assert sheets.components == 2
    assert report.self_intersections == 0


def test_distances_and_projections_are_those_of_its_surface(leaf):
    plane = inner_places(200, inset=1.5)
    rng = np.random.default_rng(3)
    world = leaf.blade.lift(np.column_stack([plane, rng.uniform(-0.45, 0.45, 200)]))
    feet = leaf.project(world)
    assert np.quantile(np.abs(leaf(feet)), 0.99) <= 1e-3
    distance = leaf.signed_distance(world)
    assert np.quantile(np.abs(np.abs(distance) - np.linalg.norm(world - feet, axis=1)), 0.95) <= SIGNED_VS_FOOT
    assert np.array_equal(distance > 0, leaf(world) > 0) or np.array_equal(distance < 0, leaf(world) > 0)


PETIOLE = Petiole(9.0, 2.0, 50.0, (-9.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


@pytest.mark.few(surface=1)
def test_it_is_written_read_and_remeshed(surface, leaf, tmp_path, flat):
    outline = Margin.fit(inner_places(1200), unit="mm")
    saved = o3l.MultiscaleLeaf(leaf.texture, blade=ParametricBlade(surface, outline, 1.0, ("a note",), None, PETIOLE))
    saved.save(tmp_path / "leaf.o3l")
    found = o3l.load(tmp_path / "leaf.o3l")
    world = leaf.blade.lift(flat)
    assert np.array_equal(found(world), saved(world))
    assert found.blade.notes == ("a note",)
    assert found.blade.rim_radius == 1.0
    assert found.blade.petiole == PETIOLE
    leaf.write_mesh(tmp_path / "leaf.ply", 0.25, closed=True)
    written = o3l.read_mesh(tmp_path / "leaf.ply")
    assert o3l.mesh_report(getattr(written, "mesh", written)).watertight
    window = leaf.blade.window(leaf.blade.lift([[20.0, 0.0, 0.0]])[0], 2.0)
    remeshed = leaf.extract_mesh(0.2, window, closed=True, remesh=0.2)
    assert o3l.mesh_report(remeshed).watertight


def test_a_summary_describes_it(even):
    summary = summarize(even, even.extract_mesh(1.0), {"output": "a"})
    assert summary["chart"]["length"] == pytest.approx(LENGTH - 1)
    assert summary["surface"]["balls"] == len(even.surface.cover.radii)
    assert "frame" not in summary
    assert summary["notes"] == ["one thing"]
    assert warnings_of(summary) == []


def test_figures_of_the_paper_s_blade_are_refused(leaf, tmp_path):
    with pytest.raises(InputError, match="frame='paper'"):
        o3l.draw_figures(leaf, tmp_path, formats=["png"], only=["height-map", "flattened"])
