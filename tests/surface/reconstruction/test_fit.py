"""Fields of noisy clouds: their surface lies in the middle of the noise."""

import numpy as np

from o3dleaf import samples
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.fit import fit_surface
from tolerances import MIDDLE_OF_NOISE

COUNT, DRAWS, NOISE = 400, 6, 0.7


def radii_of(field, directions):
    """Where rays from the origin leave a field, by Newton's method from 1 on."""
    radii = np.ones(len(directions))
    for _ in range(8):
        places = radii[:, np.newaxis] * directions
        radii -= field(places) / np.einsum("ij,ij->i", field.gradient(places), directions)
    return radii


def test_noise_along_its_normals_hardly_moves_the_surface_of_a_ball():
    """Smoothing leaves a field that bends along the normal, whose mean over points on both sides is no value on it."""
    spacing, off = np.sqrt(4 * np.pi / COUNT), []
    for seed in range(DRAWS):
        normals = samples.Sphere().sample(COUNT, seed)[1]
        errors = np.random.default_rng(seed).standard_normal(COUNT)
        cloud = OrientedCloud.of((1 + NOISE * spacing * errors)[:, np.newaxis] * normals, normals)
        # Of errors that are not 0 on the mean the surface has its share.
        off.append(radii_of(fit_surface(cloud), normals).mean() - 1 - NOISE * spacing * errors.mean())
    assert abs(np.mean(off)) < MIDDLE_OF_NOISE * spacing
