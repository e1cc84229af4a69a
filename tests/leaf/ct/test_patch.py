"""The patch of a volume is blade from side to side and nothing else, and the largest such box."""

import numpy as np
import pytest
from scipy.ndimage import label, rotate

from o3dleaf import TextureOptions, Volume, align_blade, create_texture, mesh_report
from o3dleaf.core.errors import DataWarning, ReconstructionError
from o3dleaf.leaf.ct.box import inscribed_box
from o3dleaf.leaf.ct.patch import find_patch, largest_rectangle
from o3dleaf.leaf.meshing import extract_flat_tile
from o3dleaf.samples import wheat_ct

LEVEL = 0.1
STEP = 24.0
LAYERS = 20


def flat_blade(shape=(60, 50), thickness=6, gap=10):
    """A plate in the middle of its volume, a unit a voxel."""
    data = np.zeros((*shape, 2 * gap + thickness))
    data[:, :, gap : gap + thickness] = 0.2
    return data


def found_in(data, spacing=1.0, order=None):
    """Return motion and patch of a volume: of a flat one with its axes in an order, or of one that is aligned."""
    volume = Volume(data, spacing, np.zeros(3), "um")
    transform = np.eye(4) if order else align_blade(volume, LEVEL)
    if order:
        transform[:3, :3] = np.eye(3)[:, list(order)]
    return transform, find_patch(volume, LEVEL, transform)


def island(seed=0, around=15):
    """A patch with air on all sides, in voxels of 24 micrometers."""
    volume, _ = wheat_ct(seed=seed, noise=0.0, drift=0.0)
    return np.pad(volume.data, ((around, around), (around, around), (4, 4)))


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
@pytest.mark.parametrize("noise", [0.0, 0.04])
def test_a_patch_that_fills_its_volume_is_kept_whole(order, noise):
    volume, _ = wheat_ct(seed=1, noise=noise)
    transform, patch = found_in(volume.data.transpose(order), STEP)
    turned = Volume(volume.data.transpose(order), STEP, np.zeros(3), "um")
    assert not patch.cut
    np.testing.assert_array_equal(patch.box, inscribed_box(turned.bounds, transform))
    np.testing.assert_allclose(patch.within, turned.bounds, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_where_the_blade_ends_the_box_stays_half_its_thickness_away(order):
    data = np.pad(flat_blade(), ((7, 11), (0, 9), (0, 0)))
    _, patch = found_in(data.transpose(order), order=order)
    # More than half of six voxels from the middles of the first columns without a blade.
    np.testing.assert_allclose(patch.box[:, :2], [[9.5, -0.5], [63.5, 46.5]], rtol=0, atol=1e-9)
    np.testing.assert_allclose(patch.within[:, np.argsort(order)], patch.box, rtol=0, atol=1e-9)
    assert "ends in it" in patch.cut[0]


@pytest.mark.few(degrees=1)
@pytest.mark.parametrize("degrees", [0, 10, 30])
def test_of_a_sample_that_lies_askew_the_box_is_blade_all_over(degrees):
    data = rotate(island(), degrees, axes=(0, 1), order=1)
    transform, patch = found_in(data, STEP)
    points = np.argwhere(data > LEVEL) * STEP
    flat = (points @ transform[:3, :3].T + transform[:3, 3])[:, :2]
    low, high = patch.box[:, :2]
    # Two voxels a cell: of voxels that lie askew some cells of one hold no middle.
    size = np.floor((high - low) / (2 * STEP)).astype(int)
    cells = np.floor((flat - low) / (high - low) * size).astype(int)
    inside = ((cells >= 0) & (cells < size)).all(axis=1)
    assert len(np.unique(cells[inside], axis=0)) == size.prod()
    # The sample's sides less nine voxels, its thickness, and one for each that is cut through.
    assert (high - low > STEP * (70 - 9 - 2)).all()


def test_outside_the_field_of_view_there_is_no_blade():
    data = flat_blade((81, 81))
    x, y = np.meshgrid(np.arange(81) - 40, np.arange(81) - 40, indexing="ij")
    data[np.hypot(x, y) > 40] = 0.0
    _, patch = found_in(data, order=(0, 1, 2))
    side = np.sqrt(2) * (40 - 3)
    assert (patch.box[1] - patch.box[0])[:2].prod() == pytest.approx(side**2, rel=0.1)
    assert np.hypot(*np.abs(patch.box[:, :2]).max(axis=0) - 40) < 40


def test_a_hole_in_the_blade_is_left_out():
    data = flat_blade((80, 60))
    data[20:24, 28:32] = 0.0
    _, patch = found_in(data, order=(0, 1, 2))
    np.testing.assert_allclose(patch.box[:, :2], [[26.5, -0.5], [79.5, 59.5]], rtol=0, atol=1e-9)


@pytest.mark.parametrize("thickness", [4, 24])
@pytest.mark.parametrize("side", [0, 1])
def test_a_support_is_left_out_however_thick_it_is(side, thickness):
    volume, _ = wheat_ct(seed=2, noise=0.0)
    plate = np.full((*volume.shape[:2], thickness), 0.5)
    parts = [plate, np.zeros((*volume.shape[:2], 6)), volume.data]
    data = np.concatenate(parts if side == 0 else parts[::-1], axis=2)
    transform, patch = found_in(data, STEP)
    pieces, _ = label(volume.data > LEVEL)
    solid = np.flatnonzero((pieces == 1 + np.argmax(np.bincount(pieces.ravel())[1:])).any(axis=(0, 1)))
    before = thickness + 6 if side == 0 else 0
    blade = STEP * (before + solid[[0, -1]]) + transform[2, 3]
    support = STEP * (thickness - 1 if side == 0 else volume.shape[2] + 6) + transform[2, 3]
    assert patch.box[side, 2] == pytest.approx((blade[side] + support) / 2, abs=1e-9)
    assert len(patch.cut) == 1
    assert ("below", "above")[side] in patch.cut[0]


def test_of_several_things_the_nearest_is_left_out_too():
    data = flat_blade(gap=20)
    data[:, :, 1:4] = data[:, :, 9:11] = data[:, :, 40:42] = 0.2
    _, patch = found_in(data, order=(0, 1, 2))
    # Middles of voxels: 10 and 20 below, 25 and 40 above.
    np.testing.assert_allclose(patch.box[:, 2], [15.0, 32.5], rtol=0, atol=1e-9)
    # Five and two of thirteen layers.
    assert ["below the blade, 38 %" in patch.cut[0], "above the blade, 15 %" in patch.cut[1]] == [True, True]


@pytest.mark.slow
def test_tiles_of_a_sample_with_air_around_it_close():
    volume = Volume(island(seed=3), STEP, np.zeros(3), "um")
    with pytest.warns(DataWarning, match="largest rectangle"), pytest.warns(DataWarning, match="hairs are cut"):
        texture = create_texture(volume, options=TextureOptions(level=LEVEL))
    report = mesh_report(extract_flat_tile(texture, 1.0, STEP).mesh)
    assert (report.boundary_edges, report.components) == (0, 1)


def test_a_blade_narrower_than_thick_has_no_patch():
    data = np.zeros((40, 40, 40))
    data[15:25, 15:25, 15:27] = 0.2
    volume = Volume(data, 1.0)
    with pytest.raises(ReconstructionError, match="half its thickness"):
        find_patch(volume, LEVEL, align_blade(volume, LEVEL))


def test_air_brighter_than_the_leaf_is_said():
    volume, _ = wheat_ct(seed=1)
    with pytest.raises(ReconstructionError, match="change the sign"):
        align_blade(Volume(0.2 - volume.data, STEP))


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_rectangle_is_that_of_all_tried(seed):
    rng = np.random.default_rng(seed)
    inside = rng.random((9, 11)) < (0.6, 0.9)[seed % 2]
    areas = [
        (stop - start) * (right - left)
        for start in range(9)
        for stop in range(start + 1, 10)
        for left in range(11)
        for right in range(left + 1, 12)
        if inside[start:stop, left:right].all()
    ]
    (top, left), (bottom, right) = largest_rectangle(inside)
    assert inside[top:bottom, left:right].all()
    assert (bottom - top) * (right - left) == max(areas)


def test_nothing_inside_has_no_rectangle():
    assert largest_rectangle(np.zeros((3, 4), dtype=bool)) is None
