"""Projection, normals and curvature: polynomials that splines reproduce, on a flat and on a bent blade."""

import numpy as np
import pytest

from leaf_fields import FRAMES, leaf_of, texture
from o3dleaf import MultiscaleLeaf
from tolerances import BALL_CURVATURE, BENT_CURVATURE, NORMAL, PROJECTED

RADIUS = 0.31


@pytest.fixture(scope="module")
def ball():
    return leaf_of(texture(lambda x, y, z: RADIUS**2 - x**2 - y**2 - z**2))[0]


@pytest.fixture(scope="module", params=FRAMES)
def slab(request):
    """Bent on a circle of radius 10, faces at ± RADIUS: two cylinders of radius 10 ± RADIUS; of finer data, which
    second derivatives need.
    """
    return leaf_of(texture(lambda x, y, z: RADIUS**2 - z**2), bend=10.0, frame=request.param, step=0.4)


def around(rng, count, low, high):
    """Points between two radii about the ball's middle, which is a tile's."""
    way = rng.normal(size=(count, 3))
    return way / np.linalg.norm(way, axis=1)[:, None], rng.uniform(low, high, count)[:, None]


def test_project_lands_on_the_sphere_along_the_gradient(ball):
    rng = np.random.default_rng(0)
    way, radius = around(rng, 500, 0.6 * RADIUS, 1.3 * RADIUS)
    middle = np.array([10.0, 0.0, 0.0])
    found = ball.project(middle + radius * way)
    assert np.abs(ball(found)).max() <= PROJECTED
    assert np.abs(found - middle - RADIUS * way).max() <= PROJECTED / RADIUS


def test_normals_and_curvature_of_a_sphere(ball):
    way, _ = around(np.random.default_rng(1), 300, 1, 1)
    at = np.array([10.0, 0.0, 0.0]) + RADIUS * way
    assert np.abs(ball.normals(at) - way).max() <= NORMAL
    assert np.abs(ball.mean_curvature(at) * RADIUS - 1).max() <= BALL_CURVATURE


def test_curvature_of_a_cylinder_and_of_its_inside():
    field = leaf_of(texture(lambda x, y, z: RADIUS**2 - y**2 - z**2))[0]
    hole = leaf_of(texture(lambda x, y, z: y**2 + z**2 - RADIUS**2))[0]
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 200)
    at = np.stack([np.full(200, 10.1), RADIUS * np.cos(angle), RADIUS * np.sin(angle)], axis=1)
    assert np.abs(field.mean_curvature(at) * 2 * RADIUS - 1).max() <= BALL_CURVATURE
    assert np.abs(hole.mean_curvature(at) * 2 * RADIUS + 1).max() <= BALL_CURVATURE


@pytest.mark.parametrize("face", [1, -1])
def test_curvature_of_a_bent_blade(slab, face):
    leaf, lift = slab
    rng = np.random.default_rng(3)
    s, c = rng.uniform(2, 18, 300), rng.uniform(-2, 2, 300)
    expected = face / (2 * (10 + face * RADIUS))
    found = leaf.mean_curvature(lift(s, c, np.full(300, face * RADIUS)))
    assert np.abs(found - expected).max() <= BENT_CURVATURE * abs(expected)


def test_curvature_is_half_the_divergence_of_the_normals(slab):
    field = texture(lambda x, y, z: RADIUS**2 - z**2 + 0.05 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y))
    leaf, lift = MultiscaleLeaf(field, blade=slab[0].blade), slab[1]
    rng = np.random.default_rng(4)
    at = leaf.project(lift(rng.uniform(2, 18, 100), rng.uniform(-2, 2, 100), np.full(100, 0.3)))
    h = 1e-4
    parts = [(leaf.normals(at + h * e) - leaf.normals(at - h * e))[:, k] for k, e in enumerate(np.eye(3))]
    expected = sum(parts) / (4 * h)
    assert np.abs(leaf.mean_curvature(at) - expected).max() <= BENT_CURVATURE * np.abs(expected).max()


def test_normals_are_those_of_the_mesh(slab):
    leaf, _ = slab
    mesh = leaf.extract_mesh(0.2)
    mesh.compute_triangle_normals()
    centres = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)].mean(axis=1)
    assert np.einsum("ij,ij->i", leaf.normals(centres), np.asarray(mesh.triangle_normals)).min() > 1 - 1e-4
