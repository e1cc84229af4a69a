"""A hidden stretch of margin is found by its two steps, and its mirror image is what was hidden."""

import numpy as np
import pytest
import scipy.signal
import shapely

import o3dleaf as o3l
import tolerances as tol
from o3dleaf.leaf.parametric import build
from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.mirror.halves import Halves, HiddenStretch, find_peaks
from o3dleaf.leaf.parametric.mirror.images import mirror_points
from o3dleaf.leaf.parametric.surface import ChartSurface

SPACING = 0.5
LENGTH, HALF = 60.0, 8.0
FIRST, LAST, DEPTH = 22.0, 40.0, 3.0
"""Of the hidden stretch, and how far its margin lies inside."""


def outline(bend=0.0, bites=(), others=()):
    """Return a leaf that tapers to both ends, its midrib a parabola, without boxes (start, stop, depth) of both."""
    u = np.linspace(0, LENGTH, 400)
    half = HALF * np.sin(np.pi * (0.05 + 0.9 * u / LENGTH))
    left, right = half.copy(), half.copy()
    for side, boxes in ((left, bites), (right, others)):
        for start, stop, depth in boxes:
            side[(u >= start) & (u <= stop)] -= depth
    middle = bend * (u - LENGTH / 2) ** 2
    ring = np.concatenate([np.stack([u, middle - right], 1), np.stack([u, middle + left], 1)[::-1]])
    return shapely.Polygon(ring), np.stack([u, middle + (left - right) / 2], axis=1)


def halves(**shape):
    return Halves.of(*outline(**shape), SPACING)


@pytest.mark.parametrize("bend", [0.0, 0.004])
def test_a_stretch_between_two_steps_is_found_and_the_midrib_goes_straight_on(bend):
    before = halves(bend=bend, bites=[(FIRST, LAST, DEPTH)])
    after, (stretch,) = before.bridged(5.0)
    assert stretch.side == 1
    ends = np.interp([stretch.start, stretch.stop], after.at, after.curve[:, 0])
    assert ends == pytest.approx([FIRST, LAST], abs=tol.STEP_PLACE * SPACING)
    assert stretch.depth == pytest.approx(DEPTH, rel=tol.STEP_HEIGHT)
    off = np.abs(after.curve[:, 1] - bend * (after.curve[:, 0] - LENGTH / 2) ** 2)
    inside = (after.at > FIRST) & (after.at < LAST)
    assert off[inside].max() < tol.BRIDGED_MIDRIB * DEPTH
    assert np.abs(before.curve[:, 1])[(before.at > FIRST) & (before.at < LAST)].max() > DEPTH / 4


def test_the_other_half_is_the_right_one():
    polygon, midline = outline(bites=[(FIRST, LAST, DEPTH)])
    turned = shapely.transform(polygon, lambda xy: xy * [1, -1])
    _, (stretch,) = Halves.of(turned, midline * [1, -1], SPACING).bridged(5.0)
    assert stretch.side == -1


@pytest.mark.parametrize(
    ("bites", "length"), [((), 5.0), ([(28.0, 32.0, DEPTH)], 5.0), ([(FIRST, LAST, 0.8 * SPACING)], 5.0)]
)
def test_no_step_a_short_notch_and_a_shallow_bay_are_not_hidden_stretches(bites, length):
    whole = halves(bites=bites)
    same, stretches = whole.bridged(length)
    assert stretches == ()
    assert same is whole


def with_waves(share):
    """Return the halves of a leaf with a hidden stretch, the other half's width waved by a share of it."""
    polygon, midline = outline(bites=[(FIRST, LAST, DEPTH)])
    u, v = shapely.get_coordinates(polygon).T
    waved = np.stack([u, v * np.where(v < 0, 1 + share * np.sin(0.5 * u), 1)], axis=1)
    return Halves.of(shapely.Polygon(waved), midline, SPACING)


@pytest.mark.parametrize(("share", "shown"), [(0.1, {1: True}), (0.4, {1: True, -1: False})])
def test_a_stretch_along_which_halves_differ_no_more_than_elsewhere_is_not_completed(share, shown):
    waved = with_waves(share)
    _, stretches = waved.bridged(5.0)
    assert {each.side: each.shows_in(SPACING) for each in stretches} == shown
    assert {each.side: each.beyond > 0 for each in stretches} == shown


@pytest.mark.parametrize(
    ("beyond", "elsewhere", "shown"), [(1.6, 0.5, True), (1.6, 0.6, False), (1.4, 0.1, False), (-2.0, 0.1, False)]
)
def test_what_shows_is_beyond_chance_and_beyond_what_halves_differ_elsewhere(beyond, elsewhere, shown):
    stretch = HiddenStretch(FIRST, LAST, 1, DEPTH, DEPTH * (LAST - FIRST), beyond * SPACING, elsewhere * SPACING)
    assert stretch.shows_in(SPACING) == shown


def test_stretches_of_both_halves_count_as_differences_of_each_other():
    """Lobes that alternate look like them."""
    _, stretches = halves(bites=[(12.0, 28.0, DEPTH)], others=[(32.0, 48.0, DEPTH)]).bridged(5.0)
    assert {each.side for each in stretches} == {1, -1}
    assert not any(each.shows_in(SPACING) for each in stretches)


def test_a_stretch_that_the_other_half_does_not_show_is_not_completed_and_the_note_says_why():
    alternating = halves(bites=[(12.0, 28.0, DEPTH)], others=[(32.0, 48.0, DEPTH)])
    fit, notes = build._complete(None, alternating, 5.0)
    assert fit is None
    assert len(notes) == 2
    assert all("halves differ by" in note and note.endswith("not completed") for note in notes)
    assert build._tell_hidden(alternating, alternating.polygon.area) == ()


def test_how_far_a_hidden_margin_lies_inside_the_mirror_image_is_its_depth():
    _, (stretch,) = halves(bites=[(FIRST, LAST, DEPTH)]).bridged(5.0)
    assert stretch.beyond == pytest.approx(DEPTH, rel=tol.STEP_HEIGHT)
    assert stretch.elsewhere < 0.1 * DEPTH


def test_past_its_ends_the_midrib_goes_on_straight():
    whole, places = halves(), np.array([[-5.0, 2.0], [30.0, 3.0], [LENGTH + 4.0, -1.0]])
    along, across, images = whole.mirrored(places)
    assert along == pytest.approx([0, 30.0, LENGTH])
    assert across == pytest.approx(places[:, 1])
    assert images == pytest.approx(places * [1, -1])


def test_several_stretches_do_not_overlap():
    _, stretches = halves(bites=[(10.0, 24.0, 2.0), (34.0, 50.0, DEPTH)]).bridged(5.0)
    starts = sorted(each.start for each in stretches)
    assert starts == pytest.approx([10.0, 34.0], abs=3 * SPACING)
    assert stretches[0].area > stretches[1].area


def test_of_two_steps_in_before_one_out_one_belongs_to_it():
    _, stretches = halves(bites=[(12.0, 24.0, 1.5), (24.0, 44.0, DEPTH)]).bridged(5.0)
    assert len(stretches) == 1


def curled(plane):
    """Return points of a strip curled about a line along it: each half is the other's reflection."""
    u, v = plane.T
    return np.column_stack([u, 5.0 * np.sin(v / 5.0), 5.0 * np.cos(v / 5.0)])


def twisted(plane):
    """Return points of a helicoid: each half is the other's half turn."""
    u, v = plane.T
    angle = u / 25.0
    return np.column_stack([u, v * np.cos(angle), v * np.sin(angle)])


def one_sided(plane):
    """Return points of a strip that is bent to the right of a line and flat to the left."""
    u, v = plane.T
    return np.column_stack([u, v, 0.06 * np.minimum(v, 0) ** 2])


def completed(lift):
    """Return images and places of what is hidden of a strip, the misfit of its halves, and how many points are."""
    polygon, _ = outline()
    grid = np.stack(np.meshgrid(np.arange(0.25, LENGTH, SPACING), np.arange(-HALF, HALF, SPACING)), axis=-1)
    plane = grid.reshape(-1, 2)
    plane = plane[shapely.contains_xy(polygon, plane)]
    bitten, midline = outline(bites=[(FIRST, LAST, DEPTH)])
    seen = shapely.contains_xy(bitten, plane)
    surface = ChartSurface.fit(plane[seen], lift(plane[seen]), smoothing=0.0, bounds=plane_box(polygon))
    mesh = ChartMesh(np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty((0, 2)))
    fit = SurfaceFit(surface, mesh, lift(plane[seen]), plane[seen], np.zeros(seen.sum()), None, plane[seen])
    whole, (stretch,) = Halves.of(bitten, midline, SPACING).bridged(5.0)
    points, places, misfit = mirror_points(fit, whole, stretch)
    assert not shapely.contains_xy(bitten, places).any()
    return points, places, misfit, np.sum(~seen)


@pytest.mark.parametrize("lift", [curled, twisted])
def test_the_mirror_image_of_a_half_is_the_other_one(lift):
    points, places, misfit, hidden = completed(lift)
    assert len(points) == pytest.approx(hidden, rel=tol.MIRRORED_COUNT)
    assert np.linalg.norm(points - lift(places), axis=1).max() < tol.MIRRORED_HALF * SPACING
    assert misfit < tol.MIRRORED_HALF * SPACING


def test_the_image_of_a_half_unlike_the_other_goes_on_from_what_is_seen():
    points, places, misfit, _ = completed(one_sided)
    middle = (places[:, 0] > FIRST + 2) & (places[:, 0] < LAST - 2)
    beside = middle & (places[:, 1] < HALF - DEPTH)
    away = np.linalg.norm(points - one_sided(places), axis=1)
    assert beside.sum() > 10
    assert away[beside].max() < tol.MIRRORED_SEAM * SPACING
    assert misfit > tol.MIRRORED_SEAM * SPACING / 2


def plane_box(polygon):
    return np.reshape(polygon.bounds, (2, 2)) + [[-1, -1], [1, 1]]


@pytest.fixture
def _fitted_once(monkeypatch):
    """Fit the surface of a scan once for blades that differ in their margins: it takes most of their time."""
    fit, fits = build.fit_chart_surface, {}

    def once(points, mesh, **options):
        key = points.tobytes(), mesh.vertices.tobytes(), mesh.triangles.tobytes(), mesh.chart.tobytes(), str(options)
        if key not in fits:
            fits[key] = fit(points, mesh, **options)
        return fits[key]

    monkeypatch.setattr(build, "fit_chart_surface", once)
    yield
    assert len(fits) == 1


@pytest.mark.few(kind=1)
@pytest.mark.usefixtures("_fitted_once")
@pytest.mark.parametrize(("kind", "spacing"), [("twisted", 0.9), ("petiole", 1.2)])
def test_a_margin_that_is_hidden_is_told_and_completed_where_that_is_asked_for(kind, spacing):
    leaf = o3l.samples.leaf_shape(kind)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=spacing, noise=0.2, gaps="margin")
    seen = o3l.create_blade(scan.points, unit="mm")
    assert seen.outline.area == pytest.approx(leaf.area * (1 - scan.hidden_share), rel=tol.HIDDEN_AREA)
    assert any("complete_margin" in note for note in seen.notes)
    blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(complete_margin=15.0))
    assert blade.outline.area == pytest.approx(leaf.area, rel=tol.HIDDEN_AREA)
    assert any("mirror image" in note for note in blade.notes)


@pytest.mark.slow
@pytest.mark.usefixtures("_fitted_once")
def test_a_whole_margin_is_not_completed():
    leaf = o3l.samples.leaf_shape("twisted", length=60)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.9)
    whole, asked = (
        o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(complete_margin=length))
        for length in (None, 10.0)
    )
    assert asked.outline.area == whole.outline.area
    assert any("nothing is completed" in note for note in asked.notes)
    assert not any("margin" in note for note in whole.notes)


def test_peaks_are_those_of_scipy():
    """Literal twin, which the package itself does not import: with it come SciPy's statistics."""
    generator, found = np.random.default_rng(8), 0
    for many in range(3, 203):
        jumps = np.abs(generator.normal(size=many))
        heights = np.abs(np.cumsum(jumps - jumps.mean())) if many % 2 else jumps
        least, apart = float(np.quantile(heights, 0.6)), int(generator.integers(1, 20))
        peaks = find_peaks(heights, least, apart)
        assert np.array_equal(peaks, scipy.signal.find_peaks(heights, height=least, distance=apart)[0])
        found += len(peaks)
    assert found > 1000
