"""A turned patch is turned back; a straight one is left on its axes; the box in it is full of voxels."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from o3dleaf import Volume, align_blade
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.leaf.ct.blade import thin_axis
from o3dleaf.leaf.ct.box import inscribed_box
from o3dleaf.leaf.ct.volume import apply_transform
from o3dleaf.samples import wheat_ct
from tolerances import ALIGNED_DEGREES, ALIGNED_VOXELS

SPACING = 24.0


@cache
def turned(angles, seed=0, shape=(60, 60, 34)):
    """A scan of a blade in a turned holder: the volume and T_ct_patch's rotation."""
    _, truth = wheat_ct(seed=seed, size=(2400, 2400, 480))
    R = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    origin = -0.5 * SPACING * (np.array(shape) - 1)
    ct = np.argwhere(np.ones(shape, dtype=bool)) * SPACING + origin
    place = ct @ R + truth.bounds.mean(axis=0)
    # Below and above the patch there is air; a field of known bounds falls with the distance there.
    within = (place[:, 2] > truth.bounds[0, 2]) & (place[:, 2] < truth.bounds[1, 2])
    intensity = np.where(within, np.maximum(truth(place), 0.0), 0.0)
    intensity += np.random.default_rng(seed).normal(0, 0.01, len(ct))
    return Volume(intensity.reshape(shape), SPACING, origin, "um"), R


def degrees_between(A, B):
    return np.degrees(Rotation.from_matrix(A @ B.T).magnitude())


@pytest.mark.few(seed=1, angles=1)
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("angles", [(7, -5, 20), (3, 2, -40), (-12, 6, 35)])
def test_a_known_turn_is_recovered(angles, seed):
    volume, R = turned(angles, seed)
    found = align_blade(volume)
    assert degrees_between(found[:3, :3], R.T) < ALIGNED_DEGREES
    assert abs(np.linalg.det(found[:3, :3]) - 1) < 1e-12
    # The middle of the blade is 2.5 um above the truth's z = 0, which passes 40 um under the holder's center.
    middle = apply_transform(found, (np.array([[0, 0, 2.5 - 40.0]]) @ R.T))[0]
    assert abs(middle[2]) < ALIGNED_VOXELS * SPACING


TALL = (70, 70, 64)
"""Voxels of a holder in which a blade that leans by 30° still passes from side to side."""


@pytest.mark.slow
@pytest.mark.parametrize("angles", [(30, -30, 30), (-29, 26, -25)])
def test_a_turn_of_thirty_degrees_about_every_axis_is_recovered(angles):
    volume, R = turned(angles, shape=TALL)
    assert degrees_between(align_blade(volume)[:3, :3], R.T) < ALIGNED_DEGREES


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_any_turn_of_up_to_thirty_degrees_is_recovered(seed):
    for angles in np.random.default_rng(seed).uniform(-30, 30, (10, 3)):
        volume, R = turned(tuple(angles), seed, TALL)
        assert degrees_between(align_blade(volume)[:3, :3], R.T) < ALIGNED_DEGREES


def test_hints_choose_among_the_four_senses():
    volume, R = turned((7, -5, 20))
    for up, along in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        found = align_blade(volume, up=up * R[:, 2], along=along * R[:, 0])[:3, :3]
        assert found[2] @ R[:, 2] * up > 0.99
        assert found[0] @ R[:, 0] * along > 0.99
        assert np.linalg.det(found) > 0


def test_a_straight_volume_moves_along_z_only():
    volume, _ = wheat_ct(seed=4)
    found = align_blade(volume)
    shift = found[2, 3]
    expected = np.eye(4)
    expected[2, 3] = shift
    assert np.array_equal(found, expected)
    assert abs(shift + 2.5) < ALIGNED_VOXELS * SPACING
    assert np.array_equal(inscribed_box(volume.bounds, found)[:, :2], volume.bounds[:, :2])


def test_a_blade_on_edge_is_laid_down():
    volume, _ = wheat_ct(seed=0)
    on_edge = Volume(volume.data.transpose(2, 0, 1), volume.spacing, (0, 0, 0), "um")
    found = align_blade(on_edge)[:3, :3]
    assert np.array_equal(abs(found), [[0, 1, 0], [0, 0, 1], [1, 0, 0]])


def test_the_thin_axis_is_that_of_the_covariance_of_all_voxels():
    """Of slabs of any tilt: the variances along the axes alone would tell another one of every sixth."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        shape, spacing, normal = rng.integers(4, 12, 3), rng.uniform(0.5, 3.0, 3), rng.normal(size=3)
        places = np.argwhere(np.ones(shape)) * spacing
        height = (places - places.mean(axis=0)) @ normal / np.linalg.norm(normal)
        blade = (np.abs(height) < spacing.max()).reshape(shape) & (rng.random(shape) < 0.8)
        _, directions = np.linalg.eigh(np.cov((np.argwhere(blade) * spacing).T))
        assert thin_axis(blade, spacing) == np.argmax(abs(directions[:, 0]))


@pytest.mark.slow
def test_a_finer_scan_is_thinned_without_harm():
    volume, _ = wheat_ct(seed=2, spacing=6.0, size=(1200, 1200, 480))
    assert volume.data.size > 3_000_000
    assert np.array_equal(align_blade(volume)[:3, :3], np.eye(3))


def test_the_points_lie_flat_after_the_motion():
    volume, _ = turned((7, -5, 20))
    points, values = volume.to_samples(transform=align_blade(volume))
    leaf = points[values > 0]
    inner = leaf[(abs(leaf[:, :2]) < 500).all(axis=1)]
    design = np.column_stack([inner[:, :2], np.ones(len(inner))])
    slope = np.linalg.lstsq(design, inner[:, 2], rcond=None)[0][:2]
    assert np.degrees(np.hypot(*slope)) < 2 * ALIGNED_DEGREES


def test_a_volume_without_a_blade_across_it_is_refused():
    data = np.random.default_rng(0).normal(0, 0.01, (30, 30, 30))
    data[10:20] += 1.0
    with pytest.raises(ReconstructionError, match="columns"):
        align_blade(Volume(data[:14], 1.0))


@pytest.mark.parametrize("height", [None, (-120.0, 150.0)])
def test_the_box_is_inside_and_cannot_grow(height):
    bounds = np.array([[-840.0, -840, -408], [840, 840, 408]])
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("xyz", (7, -5, 20), degrees=True).as_matrix().T
    motion[:3, 3] = (30.0, -20.0, 10.0)
    box = inscribed_box(bounds, motion, height)

    def overhang(box):
        corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
        back = (corners - motion[:3, 3]) @ motion[:3, :3]
        return max((back - bounds[1]).max(), (bounds[0] - back).max())

    assert overhang(box) <= 0
    # Largest: no other box that fits has a larger product of sides, to first order, as that is concave.
    free = 2 if height else 3
    sides = np.diff(box, axis=0)[0]
    normals = np.concatenate([motion[:3, :3].T, -motion[:3, :3].T])
    limits = np.concatenate([bounds[1], -bounds[0]]) + normals @ motion[:3, 3]
    rows = np.hstack([np.minimum(normals, 0), np.maximum(normals, 0)])
    gain = np.concatenate([-1 / sides, 1 / sides])
    fixed = [] if height is None else [(2, height[0]), (5, height[1])]
    limit = [(None, None)] * 6
    for i, value in fixed:
        gain[i] = 0.0
        limit[i] = (value, value)
    best = linprog(-gain, A_ub=rows, b_ub=limits, bounds=limit)
    assert -best.fun <= free * (1 + 1e-4)


def test_a_box_that_is_too_high_is_refused():
    bounds = np.array([[-840.0, -840, -100], [840, 840, 100]])
    motion = np.eye(4)
    with pytest.raises(InputError, match="height"):
        inscribed_box(bounds, motion, (-120.0, 150.0))
    motion[:3, :3] = Rotation.from_euler("x", 7, degrees=True).as_matrix()
    with pytest.raises(InputError, match="height"):
        inscribed_box(bounds, motion, (-120.0, 150.0))
