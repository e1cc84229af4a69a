"""Surfaces over a chart whose truth is known: lengths on them are those of the chart, or almost."""

import numpy as np

from o3dleaf.leaf.parametric.surface import ChartSurface

WIDTH, LENGTH = 12.0, 40.0
RADIUS = WIDTH / 2 / np.radians(110)
"""Of a strip whose margins are curled by 110 degrees to both sides."""
PITCH = 0.3
"""Of a spiral, by radian: its turns are 1.9 apart."""


def curled(uv):
    """A cylinder: isometric to its chart."""
    angle = uv[:, 1] / RADIUS
    return np.column_stack([uv[:, 0], RADIUS * np.sin(angle), RADIUS * np.cos(angle)])


def curled_normals(uv):
    angle = uv[:, 1] / RADIUS
    return np.column_stack([np.zeros(len(uv)), np.sin(angle), np.cos(angle)])


def twisted(uv):
    """A strip turned by 180 degrees about its middle line."""
    angle = np.pi * uv[:, 0] / LENGTH
    return np.column_stack([uv[:, 0], uv[:, 1] * np.cos(angle), uv[:, 1] * np.sin(angle)])


def rolled(uv):
    """A sheet rolled up across, more than a full turn: a spiral of Archimedes."""
    turn = 0.55 * (uv[:, 1] + WIDTH / 2) + 3.0
    radius = PITCH * turn
    return np.column_stack([uv[:, 0], radius * np.cos(turn), radius * np.sin(turn)])


def looped(uv):
    """A strip that comes back in a loop of radius 4 and goes down through itself: at u = `CROSSED`, and at 6."""
    flat, turn = np.minimum(uv[:, 0], 10), np.clip((uv[:, 0] - 10) / 4, 0, 1.5 * np.pi)
    down = np.maximum(uv[:, 0] - 10 - 6 * np.pi, 0)
    return np.column_stack([flat + 4 * np.sin(turn), uv[:, 1], 4 - 4 * np.cos(turn) - down])


CROSSED = 14 + 6 * np.pi


def surface_of(lift, count=6000, smoothing=1e-6, **options):
    """The surface through points of a strip at random places."""
    rng = np.random.default_rng(0)
    uv = rng.uniform([0, -WIDTH / 2], [LENGTH, WIDTH / 2], (count, 2))
    bounds = np.array([[-1.0, -WIDTH / 2 - 1], [LENGTH + 1, WIDTH / 2 + 1]])
    return ChartSurface.fit(uv, lift(uv), smoothing=smoothing, bounds=bounds, unit="mm", **options)


def inner_places(count, seed=1, inset=0.7):
    """Places of the strip, away from its edges."""
    half = WIDTH / 2 - inset
    return np.random.default_rng(seed).uniform([inset, -half], [LENGTH - inset, half], (count, 2))
