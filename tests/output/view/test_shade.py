"""Light: the sky in closed form, few samples as good as all, none that covers a pixel forgotten."""

import numpy as np
import pytest

from mesh_fields import wavy_sheets
from o3dleaf import extract_isosurface
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.camera_loops import mark_covered, sum_moments
from o3dleaf.output.view.film import Film, PixelSamples
from o3dleaf.output.view.shade import Shot, Surface, reflected, shade_mesh, sun_of
from o3dleaf.output.view.shade_loops import share_sky
from tolerances import FEW_SAMPLES, FEW_SAMPLES_RMS, ROUNDING, SINGLE_SHARE, SKY_NET

SIZE = (240, 120)


def gray(triangle, _weights, _facing):
    return np.full((len(triangle), 3), 0.4)


def shot_of(vertices, triangles, size=SIZE, **view):
    view = View(**{"tilt": 0.0} | view)
    vertices, triangles = np.asarray(vertices, dtype=float), np.asarray(triangles)
    return Shot(vertices, triangles, gray, Camera.framing(vertices, triangles, view, size[0] / size[1]), size, view)


@pytest.fixture(scope="module")
def blade():
    """A wavy strip of two sheets, some twenty pixels a wave."""
    return mesh_arrays(extract_isosurface(wavy_sheets(), 0.06, [[-1.2, -0.3, -0.6], [1.2, 0.3, 0.6]], closed=False))


def sky_over(shot, place, normal):
    """Return the part of the sky that one point of a mesh sees, by the samples of 3 × 3 pixels."""
    seen, surface = [], Surface.of(shot)
    for numbers in (range(3), range(3, 9)):
        rows, columns, number = (each.ravel() for each in np.meshgrid(range(3), range(3), numbers, indexing="ij"))
        count = len(number)
        samples = PixelSamples(columns + 0.5, rows + 0.5, number, np.zeros(count, dtype=np.int64))
        points, normals = np.tile(place - shot.camera.target, (count, 1)), np.tile(normal, (count, 1))
        seen.append(surface.seen(points, normals, samples, np.arange(count)))
    return np.concatenate(seen).mean()


def test_nothing_hides_the_sky_over_a_plane():
    shot = shot_of([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert sky_over(shot, np.array([0.7, 0.6, 1e-4]), [0.0, 0.0, 1.0]) == 1


@pytest.mark.parametrize("angle", [30, 60, 90, 120, 160])
def test_a_groove_hides_the_part_of_the_sky_that_its_angle_says(angle):
    """Closed form, weighted by the cosine: over a wall that meets another at an angle, (1 - cos) / 2 of it is open."""
    rise = np.radians(angle)
    along, wall = np.array([0.0, 20.0, 0.0]), 20 * np.array([np.cos(rise), 0, np.sin(rise)])
    floor, edge = np.array([20.0, 0, 0]), np.zeros(3)
    corners = [edge - along, edge + along, floor - along, floor + along, wall - along, wall + along]
    shot = shot_of(corners, [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]], direction=(0.3, 0, 1))
    # Near the edge, in reaches of a ray to the sky, the walls are as good as endless.
    open_part = sky_over(shot, np.array([0.01, 0.0, 1e-4]), [0.0, 0.0, 1.0])
    assert abs(open_part - (1 - np.cos(rise)) / 2) < SKY_NET


def test_light_is_the_sum_of_what_each_source_sends(blade):
    """Literal twin in NumPy."""
    generator, camera = np.random.default_rng(5), shot_of(*blade).camera
    normal, way = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in generator.normal(size=(2, 500, 3)))
    color, lit = generator.random((500, 3)), generator.random(500) < 0.5
    rays = np.concatenate([np.zeros((500, 3)), way], axis=1).astype(np.float32)
    way, sun = rays[:, 3:].astype(np.float64), sun_of(camera)
    half = (sun - way) / np.linalg.norm(sun - way, axis=1, keepdims=True)
    gloss = 0.05 * np.maximum((normal * half).sum(axis=1), 0) ** 20 * lit
    rim = (1 - np.clip(-(normal * way).sum(axis=1), 0, 1)) ** 3
    direct = 1.15 * np.maximum(normal @ sun, 0) * lit + 0.10 * rim
    fixed = color * direct[:, np.newaxis] + (gloss + 0.01 * rim)[:, np.newaxis]
    sky = color * (0.40 * (0.75 + 0.25 * normal @ camera.up))[:, np.newaxis]
    assert np.abs(reflected(color, normal, rays, camera, lit) - np.hstack([fixed, sky])).max() < ROUNDING


def test_pixels_share_the_sky_with_those_around_on_the_same_surface():
    """Literal twin in NumPy: filled pixels, next to one another, whose middles lie in one plane but for `depth`."""
    generator, side, samples, depth = np.random.default_rng(6), 9, 3, 0.4
    pixels = np.flatnonzero(generator.random(side**2) < 0.9)
    count = len(pixels)
    number = np.full(side**2, -1, dtype=np.int32)
    number[pixels] = np.arange(count)
    taken = generator.choice([3, 9], count).astype(np.int32)
    hits = np.where(generator.random(count) < 0.8, taken, taken - 1).astype(np.int32)
    middle, normal = generator.random((2, count, 3)).astype(np.float32)
    seen, sky = (generator.random(count) * hits).astype(np.float32), generator.random((count, 3)).astype(np.float32)
    before = generator.random((count, 3)).astype(np.float32)
    dimmed = before.copy()
    share_sky(
        pixels, number.reshape(side, side), samples, hits, taken, samples * middle, normal, depth, seen, sky, dimmed
    )  # fmt: skip
    row, column = np.divmod(pixels, side)
    near = (abs(row[:, np.newaxis] - row) <= 1) & (abs(column[:, np.newaxis] - column) <= 1) & (hits == taken)
    off = np.einsum(
        "pqc,pc->pq", middle - middle[:, np.newaxis], normal / np.linalg.norm(normal, axis=1)[:, np.newaxis]
    )
    near &= (np.abs(off) <= depth) | np.eye(count, dtype=bool)
    filled = np.flatnonzero(hits == taken)
    twin = before.astype(np.float64)
    twin[filled] = sky[filled] * (near @ (seen / hits) / np.maximum(near.sum(axis=1), 1))[filled, np.newaxis]
    assert 0.3 < near[filled].sum() / (9 * len(filled)) < 0.8
    assert np.abs(dimmed - twin).max() < SINGLE_SHARE


def test_few_samples_where_nothing_changes_are_as_good_as_all(blade):
    """Literal twin: every sample of every pixel. Half the pixels and more take fewer, and no one sees it."""
    shot = shot_of(*blade, tilt=25.0)
    few, all_of_them = shade_mesh(shot), shade_mesh(shot, contrast=0.0)
    assert np.array_equal(few[..., 3], all_of_them[..., 3])
    off = np.abs(np.sqrt(few[..., :3]) - np.sqrt(all_of_them[..., :3]))[few[..., 3] > 0]
    assert (off > 0).any(axis=1).mean() > 0.3
    assert np.sqrt(np.mean(off**2)) < FEW_SAMPLES_RMS
    assert off.max() < FEW_SAMPLES


def test_no_picture_depends_on_the_number_of_threads(blade):
    shot, before, pictures = shot_of(*blade, tilt=25.0), get_num_threads(), []
    try:
        for threads in (1, 2, 5):
            set_num_threads(threads)
            pictures.append(shade_mesh(shot).tobytes())
    finally:
        set_num_threads(before)
    assert len(set(pictures)) == 1


HAIR = [[0, 0, 0], [24, 2, 0], [24, 2.04, 0], [0, 0.04, 0], [0, 8, 0], [24, 8, 0], [24, 10, 0]]
"""A hair of a third of a pixel, and a triangle beside it that sets the scale."""


@pytest.mark.few
@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("shape", ["blade", "hair", "slivers"])
def test_no_pixel_that_a_ray_would_hit_is_left_out(blade, shape, perspective):
    """Literal twin: all rays of all pixels, for triangles of many pixels and of less than one."""
    vertices, triangles = {
        "blade": blade,
        "hair": (HAIR, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]),
        "slivers": ([[0, 0, 0], [9, 1, 0], [8, 1.01, 0.2], [4, 3, 2]], [[0, 1, 2], [1, 2, 3]]),
    }[shape]
    shot = shot_of(vertices, triangles, tilt=30.0, perspective=perspective)
    columns, rows = ((np.arange(3 * side) + 0.5) / 3 for side in SIZE)
    columns, rows = (each.ravel() for each in np.meshgrid(columns, rows))
    count = np.arange(len(rows))
    hit = np.zeros(len(rows))
    hit[Surface.of(shot).light(PixelSamples(columns, rows, count, count)).hit] = 1
    twin = hit.reshape(SIZE[1], 3, SIZE[0], 3).mean(axis=(1, 3))
    assert np.abs(shade_mesh(shot)[..., 3] - twin).max() < ROUNDING
    covered = np.zeros(SIZE[::-1], dtype=bool)
    mark_covered(shot.camera.project(shot.vertices, SIZE), shot.triangles, covered)
    assert covered.sum() < 2 * (twin > 0).sum()


@pytest.mark.parametrize("finer", range(1, 9))
def test_the_first_samples_share_no_row_and_no_column(finer):
    taken = []
    film = Film(np.ones((1, 1), dtype=bool), finer)

    def note(samples):
        taken.append(np.column_stack([samples.rows, samples.columns]) * finer - 0.5)
        raise StopIteration

    for take in (film.take_first, lambda task: film.take_others(np.ones(1, dtype=bool), task)):
        try:
            take(note)
        except StopIteration:
            continue
    first = np.round(taken[0]).astype(int)
    assert np.array_equal(np.sort(first, axis=0), np.column_stack([range(finer)] * 2))
    cells = np.unique(np.round(np.concatenate(taken)).astype(int), axis=0)
    assert len(cells) == len(np.concatenate(taken)) == finer**2


def test_moments_are_sums_over_triangles(blade):
    """Literal twin in NumPy."""
    vertices, triangles = blade
    origin, moments = np.array([0.1, -0.2, 0.3]), np.zeros((8, 3))
    sum_moments(vertices, triangles, origin, moments)
    corners = vertices[triangles] - origin
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weight, middle = np.linalg.norm(normal, axis=1), corners.mean(axis=1)
    second = np.einsum("m,mci,mcj->ij", weight, corners, corners) + 9 * (weight * middle.T) @ middle
    twin = np.vstack([normal.sum(axis=0), weight @ middle, (normal.T / weight) @ normal, second / 12])
    assert np.abs(moments - twin).max() < ROUNDING * len(triangles)
