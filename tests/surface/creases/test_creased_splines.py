"""Creases: planes come back as they are, up to where they meet, and smooth surfaces as if none were sought."""

import zlib

import numpy as np
import pytest

import o3dleaf as o3l
import tolerances
from o3dleaf import CreasedSplines, PUInterpolant
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.io.models.model_file import MAGIC, PREFIX
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def corner(faces, side, turn):
    """Return constraints and normals of so many faces of a unit cube at one corner; side −1 is the cube's outside."""
    rng = np.random.default_rng(7)
    points, normals = [], []
    for axis in range(faces):
        part = rng.random((400, 3))
        part[:, axis] = 1.0
        points.append(part)
        normals.append(np.tile(side * np.eye(3)[axis], (len(part), 1)))
    points, normals = np.concatenate(points) @ turn.T, np.concatenate(normals) @ turn.T
    base = np.arange(0, len(points), 3)
    sites = [points, points[base] + 0.05 * normals[base], points[base] - 0.05 * normals[base]]
    values = np.repeat([0.0, -0.05, 0.05], [len(points), len(base), len(base)])
    groups = np.concatenate([np.arange(len(points)), base, base])
    return np.concatenate(sites), values, groups, normals[groups]


def truth(x, faces, side, turn):
    depth = 1 - (x @ turn)[:, :faces]
    return depth.min(axis=1) if side > 0 else -depth.min(axis=1)


def near_crease(faces, turn, count=500):
    """Return points within a third of a spacing of the faces, all near creases."""
    rng = np.random.default_rng(8)
    x = rng.uniform(0.4, 0.9, (count, 3))
    x[:, :faces] = rng.uniform(0.9, 1.0, (count, faces))
    x[np.arange(count), rng.integers(0, faces, count)] = rng.uniform(0.98, 1.02, count)
    return x @ turn.T


def fitted(faces, side, turn, **options):
    sites, values, groups, normals = corner(faces, side, turn)
    return PUInterpolant.fit(sites, values, groups=groups, normals=normals, local=CreasedSplines(**options))


@pytest.mark.few
@pytest.mark.parametrize("faces", [2, 3])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["straight", "turned"])
def test_planes_that_meet_are_reproduced_up_to_their_crease(faces, side, turn):
    field = fitted(faces, side, turn)
    x = near_crease(faces, turn)
    assert isinstance(field.local, LocalCreasedSplines)
    assert np.abs(field(x) - truth(x, faces, side, turn)).max() < tolerances.CREASED


@pytest.mark.parametrize("side", [1, -1])
def test_noise_does_not_hide_a_crease(side):
    """What one spline rounds off is of the size of the noise here; sheets are wrong by less than the noise anywhere."""
    noise = 0.007
    sites, values, groups, normals = corner(2, side, TURN)
    values = values + np.random.default_rng(0).normal(0, noise, len(values))[groups]
    smoothed = CreasedSplines(rho=1e-3)
    field = PUInterpolant.fit(sites, values, groups=groups, normals=normals, local=smoothed)
    x = near_crease(2, TURN)
    assert np.abs(field(x) - truth(x, 2, side, TURN)).max() < noise


def test_gradients_are_limits_of_difference_quotients_away_from_creases():
    field = fitted(2, 1, TURN)
    x = near_crease(2, TURN)
    depth = 1 - (x @ TURN)[:, :2]
    x = x[np.abs(depth[:, 0] - depth[:, 1]) > 0.01]
    step = 1e-4 * np.eye(3)
    quotients = np.stack([(field(x + h) - field(x - h)) / 2e-4 for h in step], axis=1)
    np.testing.assert_allclose(field.gradient(x), quotients, atol=tolerances.CREASED_SLOPE)


def test_a_smooth_surface_is_fitted_as_if_no_creases_were_sought():
    points, normals = o3l.samples.Sphere().sample(2000)
    sites, values = np.concatenate([points, points + 0.05 * normals]), np.repeat([0.0, -0.05], len(points))
    groups = np.tile(np.arange(len(points)), 2)
    one = PUInterpolant.fit(sites, values, groups=groups, normals=normals[groups], local=CreasedSplines(rho="gcv"))
    other = PUInterpolant.fit(sites, values, groups=groups, rho="gcv")
    assert np.array_equal(one(points + 0.01), other(points + 0.01))


@pytest.mark.slow
def test_sheets_that_face_one_another_do_not_cut_each_other():
    """A smooth solid folded onto itself: what a sheet is where it has no points does not dent the next one."""
    solid = o3l.samples.fold(0.04)
    points, normals = solid.sample(10_000, 3)
    mesh, _ = o3l.create_from_point_cloud_rbfpu(o3l.OrientedCloud.of(points, normals), measure=None, closed=False)
    off = np.abs(solid.signed_distance(mesh_arrays(mesh)[0])).max()
    assert off < tolerances.DENT * np.sqrt(solid.area / len(points))


def test_saved_creases_are_loaded_as_they_were(tmp_path):
    field, x = fitted(3, -1, TURN), near_crease(3, TURN)
    field.save(tmp_path / "creased.o3l")
    assert np.array_equal(o3l.load(tmp_path / "creased.o3l")(x), field(x))


def test_a_file_of_version_0_1_is_read(tmp_path):
    """There the splines had another name."""
    field, x = fitted(3, -1, TURN), near_crease(3, TURN)
    file = tmp_path / "creased.o3l"
    field.save(file)
    content = file.read_bytes()
    _, length, _ = PREFIX.unpack(content[: PREFIX.size])
    header = content[PREFIX.size : PREFIX.size + length]
    older = header.replace(b'"LocalCreasedSplines"', b'"CreasedSplines"').ljust(length)
    assert older != header
    file.write_bytes(PREFIX.pack(MAGIC, length, zlib.crc32(older)) + older + content[PREFIX.size + length :])
    assert np.array_equal(o3l.load(file)(x), field(x))


def test_no_bit_depends_on_the_number_of_threads():
    x = near_crease(3, TURN)
    before = o3l.get_num_threads()
    try:
        found = []
        for threads in (1, 3):
            o3l.set_num_threads(threads)
            found.append(fitted(3, 1, TURN, rho="gcv")(x))
    finally:
        o3l.set_num_threads(before)
    assert np.array_equal(*found)


def test_creases_without_normals_or_with_no_angle_are_refused():
    sites, values, groups, normals = corner(2, 1, TURN)
    with pytest.raises(InputError, match="give normals"):
        PUInterpolant.fit(sites, values, groups=groups, local=CreasedSplines())
    with pytest.raises(InputError, match="no angle"):
        PUInterpolant.fit(sites, values, groups=groups, normals=normals, local=CreasedSplines(180))
