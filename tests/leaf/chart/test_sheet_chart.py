import numpy as np
import pytest

from o3dleaf.leaf.chart.flattening.stretch import chart_areas
from o3dleaf.leaf.chart.sheet_chart import chart_sheet
from tests import tolerances as tol
from tests.sheet_shapes import blade, ellipse, rolled, sickle, triangulated


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
    np.testing.assert_allclose(mirrored.uv, chart.uv * [1, -1], atol=tol.MIRRORED_CHART)
    lengths = [
        np.linalg.norm(each.uv[triangles[:, 0]] - each.uv[triangles[:, 1]], axis=1) for each in (chart, mirrored)
    ]
    np.testing.assert_allclose(*lengths, atol=tol.MOVED_SHEET)


def test_a_bent_leaf_keeps_its_bend_and_says_so(long_blade):
    flat, triangles = triangulated(sickle()[0], 2.0)
    chart = chart_sheet(rolled(flat, radius=120.0), triangles)
    off = np.abs(chart.midline.curve[:, 1]).max()
    # The sagitta of the arc is 60 (1 - cos 1) = 27.6; its mean line cuts it.
    assert 15 < off < 20
    assert any("bends in the blade" in note for note in chart.notes)
    assert not any("bends in the blade" in note for note in chart_sheet(*long_blade[1:]).notes)


def test_the_junction_of_a_petiole_that_was_cut_off_is_the_base():
    flat, triangles = triangulated(ellipse(60.0, 40.0), 0.9)
    # Off the axis of symmetry, where no shape would put it.
    junction = rolled(np.array([[5.0, 11.0]]), radius=120.0)[0]
    chart = chart_sheet(rolled(flat, radius=120.0), triangles, junction=junction)
    start = chart.vertices[np.argmin(np.linalg.norm(chart.uv - chart.midline.base, axis=1))]
    assert np.linalg.norm(start - junction) < 1.5
    assert any("petiole" in note for note in chart.notes)


def test_a_point_given_as_the_base_wins_over_the_petiole():
    flat, triangles = triangulated(ellipse(60.0, 25.0), 0.9)
    base, tip = rolled(np.array([[0.0, 0.0], [60.0, 0.0]]), radius=120.0)
    chart = chart_sheet(rolled(flat, radius=120.0), triangles, base=tip, junction=base)
    assert np.linalg.norm(chart.vertices[np.argmin(chart.uv[:, 0])] - tip) < 1.5
    assert any("point given" in note for note in chart.notes)


def test_the_same_sheet_gives_the_same_bits(long_blade):
    _, sheet, triangles = long_blade
    first, second = chart_sheet(sheet, triangles), chart_sheet(sheet.copy(order="F"), triangles.copy())
    np.testing.assert_array_equal(first.uv, second.uv)
