"""Blades of known leaves: each point of a scan without noise says where the leaf ends, and noise is averaged."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.surface.mesh.deviation import distance_to_mesh

INSIDE = 0.98
"""Share of a noiseless scan's points within the margin: all but those of the tip, where it is less than a spacing
wide. Held against their median alone, residuals let 0.72 of them in."""
LEFT = 0.35
"""Of the noise's deviation: what is left of it in the surface, 0.25. Balls that grew with the smoothing left 0.49."""


def test_a_point_nearer_than_half_a_spacing_says_where_the_leaf_ends():
    leaf = o3l.samples.leaf_shape("wavy", length=40)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.6, pattern="grid")
    blade = o3l.create_blade(scan.points, unit="mm")
    assert np.mean(blade.outline.contains(blade.flatten(scan.points)[:, :2])) > INSIDE


@pytest.mark.slow
def test_noise_of_half_a_spacing_is_averaged():
    leaf = o3l.samples.leaf_shape("lobed")
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.7, noise=0.5)
    blade = o3l.create_blade(scan.points, unit="mm")
    vertices = np.asarray(blade.extract_mesh(scan.spacing).vertices)
    distance = distance_to_mesh(*leaf.mesh(scan.spacing / 4), vertices)
    assert np.sqrt(np.mean(distance**2)) < LEFT * scan.noise
