"""What a blade is built from: every point of a scan without noise, however small its residual is beside others."""

import numpy as np

import o3dleaf as o3l

INSIDE = 0.98
"""Share of a noiseless scan's points within the margin: all but those of the tip, where it is less than a spacing
wide. Held against their median alone, residuals let 0.72 of them in."""


def test_a_point_nearer_than_half_a_spacing_says_where_the_leaf_ends():
    leaf = o3l.samples.leaf_shape("wavy", length=40)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.6, pattern="grid")
    blade = o3l.create_blade(scan.points, unit="mm")
    assert np.mean(blade.outline.contains(blade.flatten(scan.points)[:, :2])) > INSIDE
