"""Small leaves whose surface is known: polynomials that splines reproduce, on a flat or a bent strip.

A strip can be laid flat without stretch, so that flat coordinates on it are the same in both frames.
"""

import numpy as np
import pytest

from o3dleaf import (
    AlphaShape,
    ChartSurface,
    HeightMap,
    HeightMapBlade,
    LeafFrame,
    Margin,
    MultiscaleLeaf,
    ParametricBlade,
    PUInterpolant,
    TiledField,
)
from o3dleaf.io.labelled_mesh import RIM

FRAMES = ("surface", "paper")
MAIN_FRAME = ("surface", pytest.param("paper", marks=pytest.mark.slow))
"""Where one code serves both."""
HALF_WIDTH = 3.0
COLLAR, STEP = 2.0, 0.75
"""Width of the strip beside the leaf that the surface is fitted to as well, and the step of its data: all in
one ball, since a spline errs at the edges of its data."""


def texture(function, half=0.5, tile=2.0, n=13, per_ball=40):
    """A tile whose values are `function` of (x, y, z) about its middle; in small balls, whose values cost less."""
    x, y, z = np.meshgrid(*[np.linspace(-tile / 2, tile / 2, n)] * 2, np.linspace(-half, half, n), indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    fit = PUInterpolant.fit(points, function(*points.T), smoothing=0.0, points_per_ball=per_ball, unit="mm")
    return TiledField(fit)


def leaf_of(field, bend=None, length=20.0, height=0.0, frame="surface", step=STEP):
    """A strip `length` by 6, flat or bent about a circle of radius `bend`; the axis of z is straight up."""

    def lift(s, c, h):
        if bend is None:
            return np.stack([s, c, h], axis=-1)
        return np.stack([(bend + h) * np.sin(s / bend), c, (bend + h) * np.cos(s / bend) - bend], axis=-1)

    blade = paper_blade(lift, length, height) if frame == "paper" else surface_blade(lift, length, height, step)
    return MultiscaleLeaf(field, blade=blade), lift


def paper_blade(lift, length, height):
    """The strip as a height map over a plane along its middle."""
    s, c = grid((0, length), (-HALF_WIDTH, HALF_WIDTH), 81, 25)
    scan = lift(s, c, height + 0 * s)
    axis = lift(np.linspace(0, length, 41), np.zeros(41), np.zeros(41))
    frame = LeafFrame.fit(scan, axis, degree=5, unit="mm")
    y = frame.to_leaf(scan)
    return HeightMapBlade(frame, HeightMap.fit(y, smoothing=0.0, unit="mm"), AlphaShape(y[:, :2]))


def surface_blade(lift, length, height, step=STEP):
    """The strip as a surface over its chart, inside a rectangle."""
    wide, long = HALF_WIDTH + COLLAR, length + 2 * COLLAR
    s, c = grid((-COLLAR, length + COLLAR), (-wide, wide), round(long / step) + 1, round(2 * wide / step) + 1)
    places, points = np.column_stack([s, c]), lift(s, c, height + 0 * s)
    surface = ChartSurface.fit(places, points, smoothing=0.0, unit="mm", points_per_ball=2 * len(s))
    ring = np.array([[0, -HALF_WIDTH], [length, -HALF_WIDTH], [length, HALF_WIDTH], [0, HALF_WIDTH]])
    return ParametricBlade(surface, Margin(ring, ring, spacing=0.25, unit="mm"))


def grid(along, across, m, n):
    """The places of a grid over a rectangle."""
    return (each.ravel() for each in np.meshgrid(np.linspace(*along, m), np.linspace(*across, n)))


def off_the_field(leaf, made):
    """How far the vertices of a solid's faces lie off the field, to first order; those of its rim do not count."""
    vertices, triangles = np.asarray(made.mesh.vertices), np.asarray(made.mesh.triangles)
    faces = np.setdiff1d(triangles[made.labels != RIM], triangles[made.labels == RIM])
    return np.abs(leaf(vertices[faces])) / np.linalg.norm(leaf.gradient(vertices[faces]), axis=1)
