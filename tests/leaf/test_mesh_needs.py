"""What a mesh takes at least: told from scan and volume, and never more than it takes."""

import numpy as np
import pytest

from o3dleaf.core.resources.budget import memory_limit
from o3dleaf.core.resources.machine import resident
from o3dleaf.core.resources.measured import SHEET_TRIANGLE, TILE_COLUMN
from o3dleaf.core.resources.needs import SAFETY
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.instancing.extraction.tile_cost import cost_of_tile
from o3dleaf.leaf.mesh_needs import least_area, need_for_sheet, need_for_tile
from o3dleaf.samples.leaves.kinds import leaf_shape
from o3dleaf.samples.leaves.leaf_scan import scan_leaf

KINDS = ("curled", "eaten", "lobed", "cupped", "petiole", "layers")


@pytest.mark.few
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", [{}, {"noise": 0.5, "passes": 2}, {"pattern": "lines"}], ids=str)
def test_a_surface_has_no_less_than_its_least_area(kind, how):
    """And not six times as much: it says something."""
    shape = leaf_shape(kind)
    points = scan_leaf(shape, spacing=0.6, seed=3, **how).points
    assert shape.area / 6 < least_area(points) < shape.area


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_need_of_a_sheet_is_of_no_unit_and_falls_with_the_square_of_the_spacing(scale):
    points = scale * np.random.default_rng(0).uniform(0, [8, 5, 0.1], (500, 3))
    fine, coarse = (need_for_sheet(points, scale * step).bytes for step in (0.01, 0.02))
    assert fine == pytest.approx(4 * coarse, rel=1e-6)
    assert fine == pytest.approx(need_for_sheet(points / scale, 0.01).bytes, rel=1e-6)


def test_a_region_takes_no_more_than_its_own_area():
    points = np.random.default_rng(0).uniform(0, [80, 50, 0.1], (500, 3))
    need = need_for_sheet(points, 0.01, [[0, 0], [1, 1]])
    assert need.bytes <= np.ceil(SAFETY * SHEET_TRIANGLE.bytes * 1e4 * 4 / 3**0.5)
    assert need.bytes < need_for_sheet(points, 0.01).bytes


def test_points_in_one_place_have_no_area():
    assert least_area(np.zeros((5, 3))) == least_area(np.zeros((1, 3))) == 0


def test_a_tile_of_a_volume_takes_no_less_whichever_way_the_volume_lies():
    """The face is what its two longer sides span: 1.4 by 0.9 mm, a quarter of it at least."""
    columns = 0.25 * 1.4 * 0.9 / 0.001**2
    for order in ((14, 9, 5), (5, 14, 9), (9, 5, 14)):
        volume = Volume(np.arange(630.0).reshape(order), 100.0, unit="um")
        assert need_for_tile(volume, 0.001, "mm").bytes == pytest.approx(SAFETY * TILE_COLUMN.bytes * columns, rel=1e-6)


def test_the_time_of_a_tile_grows_with_the_points_of_its_lattice():
    """Half the step makes four times the columns and eight times the points."""
    volume = Volume(np.arange(630.0).reshape(14, 9, 5), 100.0, unit="um")
    coarse, fine = (need_for_tile(volume, step, "mm") for step in (0.002, 0.001))
    assert fine.bytes == pytest.approx(4 * coarse.bytes, rel=1e-6)
    assert fine.seconds == pytest.approx(8 * coarse.seconds, rel=1e-6)


def test_a_tile_whose_arrays_lie_in_files_needs_less_and_no_small_one_needs_more():
    columns = np.array([1e2, 1e4, 3e5])

    def needs(stated):
        with memory_limit(resident() + stated):
            return np.array([cost_of_tile(count, 100).bytes for count in columns])

    little, much = needs(300_000_000), needs(2_000_000_000)
    assert much == pytest.approx(TILE_COLUMN.bytes * columns)
    assert little[:2] == pytest.approx(much[:2])
    assert little[1] < little[2] < much[2] / 2
