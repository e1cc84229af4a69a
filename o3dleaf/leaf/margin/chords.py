"""A closed curve as chords: points on it, its corners among them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray

CORNER = np.radians(30.0)
"""A vertex of a curve where it turns by more is kept as an end of chords."""


@dataclass(frozen=True)
class Chords:
    """Chords of a closed polyline.

    Attributes
    ----------
    closed : (n + 1, 2) ndarray
        The polyline, its first point again at the end.
    along : (n + 1,) ndarray
        Length up to each of its points.
    places : (k,) ndarray
        Lengths at which a chord ends and the next one begins, ascending from 0.
    """

    closed: FloatArray
    along: FloatArray
    places: FloatArray

    @property
    def points(self) -> FloatArray:
        """(k, 2) ends of the chords, on the polyline."""
        return self._at(self.places)

    def sagittas(self) -> FloatArray:
        """Return how far (k,) the polyline strays from the chord that begins at each place."""
        chord = np.searchsorted(self.places, self.along[:-1], side="right") - 1
        start, stop = self.points, self._at(self._ends())
        direction = stop - start
        direction /= np.maximum(np.hypot(*direction.T), 1e-300)[:, None]
        away = self.closed[:-1] - start[chord]
        distance = np.abs(away[:, 0] * direction[chord, 1] - away[:, 1] * direction[chord, 0])
        sagittas = np.zeros(len(self.places))
        np.maximum.at(sagittas, chord, distance)
        return sagittas

    def halved(self, numbers: IntArray) -> "Chords":
        """Return the chords with those of the given numbers cut in two, half-way along the curve."""
        middles = (self.places[numbers] + self._ends()[numbers]) / 2
        return Chords(self.closed, self.along, np.unique(np.concatenate([self.places, middles])))

    def _ends(self) -> FloatArray:
        return np.append(self.places[1:], self.along[-1])

    def _at(self, places: FloatArray) -> FloatArray:
        return np.stack([np.interp(places, self.along, column) for column in self.closed.T], axis=1)


def chords_of(ring: FloatArray, step: float, sagitta: float) -> Chords:
    """Return the chords of a closed polyline: no longer than `step`, nor farther than `sagitta` from it.

    Parameters
    ----------
    ring : (n, 2) ndarray
        Without the first point again.
    step, sagitta : float
    """
    sides = np.roll(ring, -1, axis=0) - ring
    apart = np.hypot(*sides.T) > 0
    ring, sides = ring[apart], sides[apart]
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.abs(np.angle(np.exp(1j * (angle - np.roll(angle, 1)))))
    corners = np.flatnonzero(turn > CORNER)
    first = int(corners[0]) if len(corners) else 0
    ring = np.roll(ring, -first, axis=0)
    closed = np.vstack([ring, ring[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    stops = along[corners - first] if len(corners) > 1 else along[-1] * np.arange(3) / 3
    stops = np.append(stops, along[-1])
    pieces = [np.linspace(a, b, _count(b - a, step), endpoint=False) for a, b in pairwise(stops)]
    chords = Chords(closed, along, np.concatenate(pieces))
    while (bulging := np.flatnonzero(chords.sagittas() > sagitta + 1e-12 * along[-1])).size:
        chords = chords.halved(bulging)
    return chords


def _count(length: float, step: float) -> int:
    """Return how many pieces of at most a step, but for rounding, a length has."""
    return max(1, int(np.ceil(length / step * (1 - 1e-12))))
