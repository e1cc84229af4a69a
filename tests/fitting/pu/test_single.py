"""Single precision on request: its type, its error, and what is refused."""

import math

import numpy as np
import pytest

import reference
from o3dleaf import PUInterpolant, RBFInterpolant, TiledField
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import CHANGED, SINGLE

UNIT = 2.0**-24
"""The unit roundoff of float32."""

PLACE = 1000.0
"""Far from the origin: float32 would keep four digits of these coordinates, but sums run in those of a ball."""


def fitted(power=3, d=3, scale=1.0, **options):
    points, queries = PLACE + np.random.default_rng(d).random((2, 600, d))
    values = scale * np.sin(5 * (points - PLACE)).sum(axis=1)
    field = PUInterpolant.fit(points, values, kernel=Polyharmonic(power, d), points_per_ball=(40, 80), **options)
    return field, np.vstack([queries, points[:50], field.cover.centers, PLACE + 3 * (queries[:50] - PLACE)])


def radial_sizes(power, r):
    """Bounds of |φ|, |φ′|, |φ″| and |φ‴| of ±r^p or ±r^p log r: beside log r stands 1/p + 1/(p − 1) + ... < 2."""
    factor = 1 if power % 2 else np.abs(np.log(r)) + 2
    return [math.perm(power, k) * r ** (power - k) * factor for k in range(4)]


def ball_errors(field, ball, at):
    """Bounds of the error of one ball's value, slopes and second derivatives at the points, by (n − 1) u Σ|terms|.

    That is what the sum of n terms may lose in any order, however many a processor adds at once (Higham 2002, 4.2), and
    a few roundings more in each term. In unit coordinates, with roundings of z, z_j and z − z_j, the latter is 4 u off.
    """
    sites, weights, _ = field.local.ball(ball)
    radius = field.cover.radii[ball]
    r = reference.distances((at - field.cover.centers[ball]) / radius, sites.T) + 4 * UNIT
    sizes = [size @ np.abs(weights) for size in radial_sizes(field.local.kernel.power, r)]
    roundings = len(weights) + SINGLE
    return [UNIT * (roundings * sizes[k] + 4 * sizes[k + 1]) / radius**k for k in range(3)]


def blended_errors(field, at):
    """Bounds of the errors at points, as the weights p = w/W and Leibniz's rule hand on those of the balls.

    On axes along which a point lies outside, the weights do not change. Where all balls that hold a point are about to
    let go of it, p′ and p″ are large: the errors are, too.
    """
    centres, radii = field.cover.centers, field.cover.radii
    balls = [ball_errors(field, ball, at) for ball in range(len(radii))]
    bounds = np.zeros((3, len(at)))
    for i, x in enumerate(np.clip(at, *field.bounds)):
        inside, stays = np.flatnonzero(np.linalg.norm(x - centres, axis=1) < radii), (x == at[i]).astype(float)
        jets = {ball: reference.weight_jet(x - centres[ball], radii[ball]) for ball in inside}
        jets = {ball: (w, gw * stays, hw * np.outer(stays, stays)) for ball, (w, gw, hw) in jets.items()}
        W, gW, hW = (sum(parts) for parts in zip(*jets.values(), strict=True))
        for ball, (w, gw, hw) in jets.items():
            p = w / W
            gp = (gw - p * gW) / W
            hp = (hw - np.outer(gp, gW) - np.outer(gW, gp) - p * hW) / W
            gp, hp = np.abs(gp).max(), np.abs(hp).max()
            value, slope, bend = (errors[i] for errors in balls[ball])
            bounds[:, i] += p * value, gp * value + p * slope, hp * value + 2 * gp * slope + p * bend
    return bounds


@pytest.mark.few(power=4)
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
@pytest.mark.parametrize(("power", "d"), [(3, 1), (3, 2), (4, 2), (3, 3), (5, 3), (3, 4)])
def test_the_error_is_a_rounding_of_the_terms_of_the_sum(power, d, smoothing):
    """Not of their sum, which is less by as much as the λ_j φ(r_j) of one ball cancel one another.

    At every point, also outside: weights are those of the nearest point of the box, sums those at the point.
    """
    field, at = fitted(power, d, smoothing=smoothing)
    bounds = blended_errors(field, at)
    shares = []
    for call, bound in zip((field, field.gradient, field.hessian), bounds, strict=True):
        double, single = call(at), call(at, dtype="float32")
        assert (double.dtype, single.dtype) == (np.float64, np.float32)
        rounded = bound.reshape(-1, *[1] * (double.ndim - 1)) + UNIT * np.abs(double)
        assert np.all(np.abs(single - double) <= rounded)
        inside = np.all((at >= field.bounds[0]) & (at <= field.bounds[1]), axis=1)
        shares.append(np.mean((single != double.astype(np.float32))[inside]))
    # The sums were formed in it, not the result alone, whose rounding may hide all others where λ_j are smoothed away.
    assert shares[2] > CHANGED[2]
    assert smoothing or all(np.greater(shares, CHANGED))


def test_the_gradient_and_the_hessian_in_single_precision_are_finite_at_data_of_any_size():
    """λ_j d dᵀ/r at r = 0, for λ up to 1e17."""
    for scale in (1e-10, 1e6, 1e10, 1e14):
        field, at = fitted(scale=scale)
        for call in (field, field.gradient, field.hessian):
            assert np.isfinite(call(at, dtype=np.float32)).all()


def test_other_blends_give_single_precision_too():
    field, at = fitted()
    points = PLACE + np.random.default_rng(0).random((200, 3))
    plain = PUInterpolant.fit(points, points[:, 0] ** 2, local=RBFInterpolant.fit, points_per_ball=50)
    for each in (TiledField(field), plain):
        for call in (each, each.gradient, each.hessian):
            assert call(at, dtype=np.float32).dtype == np.float32
    np.testing.assert_array_equal(plain(at, dtype=np.float32), plain(at).astype(np.float32))


@pytest.mark.parametrize("dtype", [int, complex, np.float16, np.longdouble, object, "banana", "S4"])
def test_any_other_kind_of_number_is_refused(dtype):
    field, at = fitted()
    for call in (field, field.gradient, field.hessian):
        with pytest.raises(InputError, match="give float64 or float32"):
            call(at, dtype=dtype)
    with pytest.raises(InputError, match="give float64 or float32"):
        field.on_lattice(field.bounds, 0.5, dtype=dtype)
