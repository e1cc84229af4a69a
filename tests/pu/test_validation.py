"""Held-out errors without refitting equal those of a refit without the group."""

import numpy as np
import reference
from tolerances import HELD_OUT

from o3dleaf.pu.cover import Cover
from o3dleaf.pu.validation import held_out_errors
from o3dleaf.rbf.kernels import polyharmonic
from o3dleaf.rbf.smoothing import Smoothing

KERNEL = polyharmonic(2, 2)


def scan(count=120):
    rng = np.random.default_rng(0)
    points = rng.random((count, 2))
    return points, np.sin(4 * points).sum(axis=1) + 0.1 * rng.standard_normal(count), rng.uniform(0.5, 2, count)


def literal(cover, points, values, trust, groups, smoothing):
    """Σ w_i (f_j − F_i without the group of j) / Σ w_i, over the balls that hold j, one refit each."""
    errors = np.empty(len(points))
    for j, x in enumerate(points):
        top = bottom = 0.0
        for ball, (centre, radius) in enumerate(zip(cover.centres, cover.radii, strict=True)):
            members = cover.members[cover.offsets[ball] : cover.offsets[ball + 1]]
            kept = members[groups[members] != groups[j]]
            if j not in members or len(kept) < 2 * 3:
                continue
            diagonal = smoothing.diagonal(len(members)) / trust[kept]
            fit = reference.solve_spline(points[kept], values[kept], 2, 1, diagonal)
            w = reference.wendland(np.linalg.norm(x - centre) / radius)
            top += w * (values[j] - fit(x[None])[0])
            bottom += w
        errors[j] = top / bottom if bottom else np.nan
    return errors


def test_each_group_is_left_out_of_every_ball():
    points, values, trust = scan()
    cover = Cover.fit(points, np.array([points.min(axis=0), points.max(axis=0)]), (20, 40), 1.1)
    for groups in (np.arange(len(points)), (points[:, 0] * 6).astype(np.int64)):
        for smoothing in (Smoothing(0.0), Smoothing(0.05), Smoothing(1e-4, 1 / KERNEL.theta)):
            fast = held_out_errors(
                cover, points, values, groups, kernel=KERNEL, degree=1, smoothing=smoothing, trust=trust
            )
            slow = literal(cover, points, values, trust, groups, smoothing)
            np.testing.assert_allclose(fast, slow, rtol=0, atol=HELD_OUT)


def test_a_group_that_leaves_too_few_points_has_no_error():
    points, values, _ = scan(30)
    cover = Cover.fit(points, np.array([points.min(axis=0), points.max(axis=0)]), (20, 40), 1.1)
    errors = held_out_errors(
        cover, points, values, np.zeros(30, dtype=np.int64), kernel=KERNEL, degree=1, smoothing=Smoothing(0.1)
    )
    assert np.isnan(errors).all()
