"""Fields with a known surface, for the tests of mesh and view: nothing here is fitted."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Analytic:
    """A Field out of a function of (x, y, z), larger inside; outside its bounds it falls with the distance."""

    function: object
    bounds: np.ndarray = field(default_factory=lambda: np.array([[-1.2] * 3, [1.2] * 3]))
    unit: str | None = None

    def __call__(self, points):
        points = np.atleast_2d(np.asarray(points, dtype=np.float64))
        nearest = np.clip(points, *self.bounds)
        return self.function(*nearest.T) - np.linalg.norm(points - nearest, axis=1)

    def gradient(self, points):
        raise NotImplementedError


# A little off the lattice's own symmetry, so that no sample lies on the surface by accident.
CENTRE = (0.013, -0.021, 0.007)


def sphere(radius=1.0, centre=CENTRE):
    a, b, c = centre
    return Analytic(lambda x, y, z: radius - np.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2))


def torus(ring=0.8, tube=0.3):
    a, b, c = CENTRE
    return Analytic(lambda x, y, z: tube - np.hypot(np.hypot(x - a, y - b) - ring, z - c))


def wavy_sheets(thickness=0.15):
    """A slab between two wavy sheets that leaves the bounds on four sides."""
    return Analytic(lambda x, y, z: thickness - np.abs(z - 0.2 * np.sin(3 * x + 0.1) * np.cos(2 * y)))


def hashed_noise(seed, shape=(12, 13, 11), *, levels=None):
    """Return random samples, padded with outside: whole numbers below `levels`, or normal deviates."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=shape) if levels is None else rng.integers(0, levels, size=shape).astype(np.float64)
    return np.pad(noise, 1, constant_values=-5.0)
