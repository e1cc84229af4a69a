"""Folds: told where, and only where, the micro-structure reaches beyond the focal surface of its blade."""

import numpy as np
import pytest

import o3dleaf as o3l
from chart_fields import LENGTH, WIDTH, surface_of
from leaf_fields import texture
from o3dleaf.leaf.folds import Folds
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.output.report.summary import warnings_of

HALF = 0.2


def bent(radius):
    """A plane, an arc of a quarter turn over the middle of the strip, and a plane again."""

    def lift(uv):
        arc = radius * np.pi / 2
        angle = np.clip((uv[:, 0] - LENGTH / 2) / radius + np.pi / 4, 0, np.pi / 2)
        before, after = np.minimum(uv[:, 0] - (LENGTH - arc) / 2, 0), np.maximum(uv[:, 0] - (LENGTH + arc) / 2, 0)
        return np.column_stack([before + radius * np.sin(angle), uv[:, 1], radius * (1 - np.cos(angle)) + after])

    return lift


def folds_at(radius):
    rng = np.random.default_rng(0)
    outline = Margin.fit(rng.uniform([0.5, 0.5 - WIDTH / 2], [LENGTH - 0.5, WIDTH / 2 - 0.5], (3000, 2)), unit="mm")
    blade = ParametricBlade(surface_of(bent(radius)), outline)
    sheet = texture(lambda x, y, z: HALF - z * z / HALF + 0 * x * y)
    return Folds.of(o3l.MultiscaleLeaf(sheet, blade=blade)), blade


def test_a_blade_that_bends_gently_has_no_folds():
    folds, _ = folds_at(10 * HALF)
    assert folds.share == 0.0
    assert folds.warnings == folds.to_dict()["warnings"] == []
    assert folds.to_dict()["radius"] is None


def test_a_tight_bend_is_told_with_its_radius_its_place_and_its_share():
    folds, blade = folds_at(0.4 * HALF)
    assert 0 < folds.radius < HALF
    bend = LENGTH / 2 + np.array([[-1.0, 1.0]]) * 3 * HALF
    assert 0 < folds.share < np.ptp(bend) / LENGTH
    (place,) = folds.places
    along = blade.flatten([place.center])[0, 0]
    assert bend[0, 0] < along < bend[0, 1]
    (warning,) = warnings_of({"folds": folds.to_dict()})
    assert str(place) in warning
    assert "bends more tightly" in warning
    assert place.share == pytest.approx(folds.share)
