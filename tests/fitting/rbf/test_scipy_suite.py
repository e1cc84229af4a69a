"""SciPy's own tests of `RBFInterpolator`, run on our interpolants through an adapter.

They are imported from the installed SciPy, whose wheels contain them. What does not apply, and why, is listed here, and
a kernel or a number of columns that comes to be supported is taken off the list.
"""

import numpy as np
import pytest

from o3dleaf import PUInterpolant, RBFInterpolant
from o3dleaf.fitting.rbf.shaped.shaped_kernels import PROFILES

theirs = pytest.importorskip(
    "scipy.interpolate.tests.test_rbfinterp",
    reason="this SciPy was built without its tests, scipy.interpolate.tests",
    exc_type=ImportError,
)

MIN_WEIGHT = 1e-12
"""SciPy takes one smoothing a point; ours is one number over weights, which are above 0."""

THEIR_WORDS = "is about the words of SciPy's error; ours are in test_scipy_parity.py"
NEITHER = {
    "test_chunking": "looks into SciPy's class: its chunks",
    "test_complex_data": "complex numbers are no values; real and imaginary parts are two columns",
    "test_degree_warning": "a tail below the least degree is an error here, in SciPy a warning",
    "test_inconsistent_x_dimensions_error": THEIR_WORDS,
    "test_inconsistent_d_length_error": THEIR_WORDS,
    "test_y_not_2d_error": THEIR_WORDS,
    "test_inconsistent_smoothing_length_error": "smoothing is one number; weights are checked in test_weights.py",
    "test_invalid_kernel_name_error": THEIR_WORDS,
    "test_epsilon_not_specified_error": THEIR_WORDS,
    "test_x_not_2d_error": THEIR_WORDS,
    "test_not_enough_observations_error": "is a warning here, see test_contradictions.py",
    "test_rank_error": "is a warning here, see test_contradictions.py",
}
BLENDED = NEITHER | {
    "test_minus_one_degree": "a tail below the least degree is an error in balls",
    "test_concurrency": "is that of test_determinism.py",
    "test_equivalent_to_rbf_interpolator": "is about SciPy's choice of neighbors",
}
SPLINE = NEITHER | {"test_equivalent_to_rbf_interpolator": "compares two of SciPy's ways"}


def adapt(fit, y, d, **options):
    """Fit as SciPy's constructor would, in its words."""
    kernel = options.setdefault("kernel", "thin_plate_spline")
    if fit != RBFInterpolant.fit:
        options.pop("epsilon", None)  # means something to kernels with a shape parameter alone
        if kernel in PROFILES:
            pytest.skip(f"{kernel} is a kernel of the single interpolant")
    smoothing = np.asarray(options.get("smoothing", 0.0))
    if smoothing.ndim:
        share = smoothing / smoothing.max()
        options |= {
            "smoothing": smoothing.max() * MIN_WEIGHT,
            "weights": MIN_WEIGHT / np.maximum(share, MIN_WEIGHT),
        }
    return fit(y, d, **options)


def without(suite, reasons):
    """Return a suite of SciPy's less the tests that do not apply."""
    return type(suite.__name__, (suite,), dict.fromkeys(reasons))


@pytest.fixture
def xp():
    """Return the module of arrays that SciPy's tests ask for."""
    return np


class TestRBFInterpolant(without(theirs.TestRBFInterpolatorNeighborsNone, SPLINE)):
    """One spline."""

    def build(self, *args, **kwargs):
        return adapt(RBFInterpolant.fit, *args, **kwargs)


class TestPUInterpolant(without(theirs.TestRBFInterpolatorNeighborsNone, BLENDED)):
    """A blend, at its usual size of balls."""

    def build(self, *args, **kwargs):
        return adapt(PUInterpolant.fit, *args, **kwargs)


class TestSmallBalls(without(theirs._TestRBFInterpolator, BLENDED)):
    """A blend of many balls, as SciPy's `neighbors`: limits of one fit of all data are not asked of it."""

    def build(self, *args, **kwargs):
        return adapt(PUInterpolant.fit, *args, points_per_ball=(30, 60), **kwargs)


@pytest.mark.parametrize("reasons", [SPLINE, BLENDED])
def test_what_is_left_out_is_there(reasons):
    """Else a name that SciPy gave up would stay on the list."""
    suites = [theirs.TestRBFInterpolatorNeighborsNone, theirs.TestRBFInterpolatorNeighbors20]
    known = {name for suite in suites for name in dir(suite)} | {"test_equivalent_to_rbf_interpolator"}
    assert set(reasons) <= known
