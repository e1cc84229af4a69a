"""Small leaves whose surface is known: polynomials that splines reproduce, on a flat or a bent strip."""

import numpy as np

from o3dleaf import AlphaShape, HeightMap, LeafFrame, MultiscaleLeaf, PUInterpolant, TiledField


def texture(function, half=0.5, tile=2.0, n=13):
    """A tile whose values are `function` of (x, y, z) about its middle."""
    x, y, z = np.meshgrid(*[np.linspace(-tile / 2, tile / 2, n)] * 2, np.linspace(-half, half, n), indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return TiledField(PUInterpolant.fit(points, function(*points.T), smoothing=0.0, unit="mm"))


def leaf_of(field, bend=None, length=20.0, height=0.0):
    """A strip `length` by 6, flat or bent about a circle of radius `bend`; the axis of z is straight up."""

    def lift(s, c, h):
        if bend is None:
            return np.stack([s, c, h], axis=-1)
        return np.stack([(bend + h) * np.sin(s / bend), c, (bend + h) * np.cos(s / bend) - bend], axis=-1)

    s, c = (a.ravel() for a in np.meshgrid(np.linspace(0, length, 81), np.linspace(-3, 3, 25)))
    scan = lift(s, c, height + 0 * s)
    axis = lift(np.linspace(0, length, 41), np.zeros(41), np.zeros(41))
    frame = LeafFrame.fit(scan, axis, degree=5, unit="mm")
    y = frame.to_leaf(scan)
    return MultiscaleLeaf(field, frame, HeightMap.fit(y, smoothing=0.0, unit="mm"), AlphaShape(y[:, :2])), lift
