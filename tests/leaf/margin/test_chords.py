"""How far a closed curve strays from its chords, the one over its beginning included."""

import numpy as np
import pytest

from o3dleaf.leaf.margin.chords import Chords, chords_of
from tolerances import ROUNDING


@pytest.mark.parametrize("corners", [3, 4, 7])
def test_all_chords_of_a_circle_have_one_sagitta(corners):
    """R (1 − cos π/k), if its points are at the ends and half-way between."""
    angles = 2 * np.pi * np.arange(20 * corners + 1) / (20 * corners)
    closed = 3.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    closed[-1] = closed[0]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    chords = Chords(closed, along, along[:-1:20])
    np.testing.assert_allclose(chords.sagittas(), 3.0 * (1 - np.cos(np.pi / corners)), atol=ROUNDING)
    halved = chords.halved(np.arange(corners))
    np.testing.assert_allclose(halved.sagittas(), 3.0 * (1 - np.cos(np.pi / corners / 2)), atol=ROUNDING)


def test_no_chord_strays_farther_than_it_may():
    angles = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    ring = np.column_stack([2 * np.cos(angles), np.sin(angles)]) * (1 + 0.2 * np.cos(5 * angles))[:, None]
    chords = chords_of(ring, 1.0, 0.01)
    assert chords.sagittas().max() <= 0.01 * (1 + ROUNDING)
    ends = np.append(chords.places, chords.along[-1])
    assert np.diff(ends).max() <= 1.0 + ROUNDING
