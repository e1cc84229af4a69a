"""Single precision on request: its type, its error, and what is refused."""

import numpy as np
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.leaf.texture.tiling import TiledField
from tolerances import SINGLE

PLACE = 1000.0
"""Far from the origin: float32 would keep four digits of these coordinates, but sums run in those of a ball."""


def fitted(power=3, d=3, scale=1.0, **options):
    points, queries = PLACE + np.random.default_rng(d).random((2, 600, d))
    values = scale * np.sin(5 * (points - PLACE)).sum(axis=1)
    field = PUInterpolant.fit(points, values, kernel=Polyharmonic(power, d), points_per_ball=(40, 80), **options)
    return field, np.vstack([queries, points[:50], field.cover.centres, PLACE + 3 * (queries[:50] - PLACE)])


@pytest.mark.parametrize("smoothing", [0.0, 0.1])
@pytest.mark.parametrize(("power", "d"), [(3, 1), (3, 2), (4, 2), (3, 3), (5, 3), (3, 4)])
def test_the_error_is_a_rounding_of_the_terms_of_the_sum(power, d, smoothing):
    """Not of their sum, which is less by as much as the λ_j φ(r_j) of one ball cancel one another."""
    field, at = fitted(power, d, smoothing=smoothing)
    terms = np.add.reduceat(np.abs(field.local.weights), field.cover.offsets[:-1]).max()
    calls = field, field.gradient, field.hessian
    for level, call in enumerate(calls):
        double, single = call(at), call(at, dtype="float32")
        assert (double.dtype, single.dtype) == (np.float64, np.float32)
        assert np.any(single != double.astype(np.float32))  # the sums were formed in it, not the result alone
        size = terms / field.cover.radii.min() ** level
        error = np.abs(single - double).max()
        assert 0 < error <= SINGLE[level] * size + np.finfo(np.float32).eps * np.abs(double).max()


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
