import numpy as np
import pytest

from o3dleaf.leaf.chart.flattening.stretch import chart_areas
from o3dleaf.leaf.chart.sheet_chart import chart_sheet
from tests import tolerances as tol
from tests.sheet_shapes import blade, rolled, sickle, stalked, triangulated


@pytest.fixture(scope="module")
def long_blade():
    flat, triangles = triangulated(blade(), 2.0)
    return flat, rolled(flat, radius=120.0), triangles


def test_the_midrib_lies_along_u_from_the_base_and_the_upper_side_is_on_top(long_blade):
    _, sheet, triangles = long_blade
    for up in (None, [0, 0, -1], [0, 0, 1]):
        chart = chart_sheet(sheet, triangles, up=up)
        assert np.allclose(chart.midline.base, [0, 0], atol=0.3)
        assert abs(chart.uv[:, 0].min()) < 0.3
        assert np.abs(chart.midline.curve[:, 1]).max() < 0.3
        assert np.all(chart_areas(chart.uv, chart.triangles) > 0)
        a, b, c = (chart.vertices[chart.triangles[:, k]] for k in range(3))
        assert np.sign(np.cross(b - a, c - a).sum(axis=0)[2]) == (1 if up is None else up[2])


def test_a_mirror_image_has_the_mirrored_chart(long_blade):
    _, sheet, triangles = long_blade
    chart, mirrored = chart_sheet(sheet, triangles), chart_sheet(sheet * [1, -1, 1], triangles[:, ::-1])
    np.testing.assert_allclose(mirrored.uv, chart.uv * [1, -1], atol=tol.MOVED_SHEET)


def test_a_bent_leaf_keeps_its_bend_and_says_so(long_blade):
    flat, triangles = triangulated(sickle()[0], 2.0)
    chart = chart_sheet(rolled(flat, radius=120.0), triangles)
    off = np.abs(chart.midline.curve[:, 1]).max()
    # The sagitta of the arc is 60 (1 - cos 1) = 27.6; its mean line cuts it.
    assert 15 < off < 20
    assert any("bends in the blade" in note for note in chart.notes)
    assert not any("bends in the blade" in note for note in chart_sheet(*long_blade[1:]).notes)


def test_a_petiole_is_named_and_cut_off_or_kept_on_request():
    flat, triangles = triangulated(stalked(stub=8.0), 0.9)
    sheet = rolled(flat, radius=120.0)
    cut, kept = chart_sheet(sheet, triangles), chart_sheet(sheet, triangles, keep_petiole=True)
    assert cut.petiole == kept.petiole
    assert any(note.endswith("cut off") for note in cut.notes)
    assert any("kept" in note for note in kept.notes)
    assert np.ptp(cut.uv[:, 0]) == pytest.approx(60, abs=2)
    assert np.ptp(kept.uv[:, 0]) == pytest.approx(105, abs=1)
    assert cut.midline.length == pytest.approx(60, abs=2)
    assert len(kept.vertices) == len(sheet)
    # The base of what is kept is the petiole's end.
    assert np.linalg.norm(kept.vertices[np.argmin(kept.uv[:, 0])] - rolled(np.array([[-5.0, 0]]), radius=120.0)) < 5


def test_a_point_given_as_the_base_wins_over_the_petiole():
    flat, triangles = triangulated(stalked(), 0.9)
    tip = rolled(np.array([[100.0, 0.0]]), radius=120.0)[0]
    chart = chart_sheet(rolled(flat, radius=120.0), triangles, base=tip)
    assert chart.petiole is not None
    assert np.linalg.norm(chart.vertices[np.argmin(chart.uv[:, 0])] - tip) < 1.5
    assert any("point given" in note for note in chart.notes)


def test_the_same_sheet_gives_the_same_bits(long_blade):
    _, sheet, triangles = long_blade
    first, second = chart_sheet(sheet, triangles), chart_sheet(sheet.copy(order="F"), triangles.copy())
    np.testing.assert_array_equal(first.uv, second.uv)
