"""Data that a fit can take in part only are told: points that coincide and differ, places that leave the tail open."""

import warnings

import numpy as np
import pytest

from o3dleaf import PUInterpolant, RBFInterpolant
from o3dleaf.core.errors import DataWarning

FITS = pytest.mark.parametrize("fit", [PUInterpolant.fit, RBFInterpolant.fit], ids=["balls", "single"])


def data():
    rng = np.random.default_rng(0)
    points, values = rng.random((120, 3)), rng.random(120)
    points[[5, 40]] = points[9] = [0.25, 0.5, 0.75]
    points[20] = points[21]
    return points, values


@FITS
@pytest.mark.parametrize("columns", [False, True])
def test_points_that_coincide_and_differ_are_counted_and_placed(fit, columns):
    points, values = data()
    values[20] = values[21]
    values = np.column_stack([np.zeros(len(values)), values]) if columns else values
    with pytest.warns(DataWarning, match=r"different values at 1 place, the first at 0\.2500 0\.5000 0\.7500") as told:
        field = fit(points, values)
    assert told[0].filename == __file__
    np.testing.assert_allclose(field(points[5:6])[0], values[[5, 9, 40]].mean(axis=0), rtol=0, atol=1e-6)
    values[20] += 1
    with pytest.warns(DataWarning, match="at 2 places"):
        fit(points, values)


@FITS
def test_smoothing_takes_them_and_equal_values_are_no_contradiction(fit):
    points, values = data()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(points, values, smoothing=0.1)
        fit(points, values, smoothing="gcv")
        fit(points, np.sin(points).sum(axis=1))
        fit(points, points)


def test_a_thin_plate_over_a_line_is_told():
    """A plate that rests on a line alone can turn about it: what it is beside the line is a guess."""
    t = np.linspace(0, 1, 20)
    line = np.column_stack([t, 2 * t])
    with pytest.warns(DataWarning, match="rank 2 of the 3 terms of degree 1: off their common plane or curve") as told:
        field = RBFInterpolant.fit(line, t, kernel="thin_plate_spline")
    assert told[0].filename == __file__
    np.testing.assert_allclose(field(line), t, rtol=0, atol=1e-9)
    with pytest.warns(DataWarning, match="rank 2 of the 3"):
        RBFInterpolant.fit(line[:2], t[:2], kernel="thin_plate_spline")
