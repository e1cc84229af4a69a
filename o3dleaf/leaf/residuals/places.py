"""The places where a blade does not hold its scan: groups of points or of pieces of the blade, the largest first."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import tell_share

JOINED = 4.0
"""Spacings between points of one place."""
MAX_POINTS = 5_000
"""Points that places are found among; of more, as many of them, evenly."""
PLACES = 3
"""Places that are named, the largest first."""
MIN_SHARE = 0.1
"""Share of all that is not held that a place has at least: below, it is scattered."""


@dataclass(frozen=True)
class Place:
    """A place in the world and what lies there.

    Attributes
    ----------
    center : (3,) tuple of float
        The point of the place nearest to its mean, rounded to a decimal that is below the scan's spacing.
    share : float
        Of the scan's points, or of the blade's area.
    """

    center: tuple[float, ...]
    share: float

    def __str__(self) -> str:
        return " ".join(f"{part:.12g}" for part in self.center)

    def to_dict(self) -> dict[str, Any]:
        """Return both as plain values."""
        return asdict(self) | {"center": list(self.center)}


def find_places(points: FloatArray, chosen: BoolArray, spacing: float) -> tuple[Place, ...]:
    """Return the places of the chosen of (n, 3) points: groups, `JOINED` spacings or less from point to point.

    The share of a place is that of n; what lies scattered has no place.
    """
    rows = np.flatnonzero(chosen)
    if not len(rows):
        return ()
    every = -(-len(rows) // MAX_POINTS)
    few = points[rows[::every]]
    # Of every k-th point of a surface the next one is √k times as far.
    pairs = cKDTree(few).query_pairs(JOINED * spacing * float(np.sqrt(every)), output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(few), len(few)))
    _, group = connected_components(graph, directed=False)
    shares = np.bincount(group) / len(few)
    largest = [number for number in np.argsort(-shares, kind="stable")[:PLACES] if shares[number] >= MIN_SHARE]
    whole = len(rows) / len(points)
    decimals = int(np.ceil(-np.log10(spacing or 1.0)))
    return tuple(Place(_middle(few[group == number], decimals), float(shares[number] * whole)) for number in largest)


def tell_places(places: tuple[Place, ...]) -> str:
    """Return the places in words, for the end of a sentence."""
    if not places:
        return "scattered"
    if len(places) == 1:
        return f"most at {places[0]}"
    return ", ".join(f"{tell_share(place.share)} at {place}" for place in places)


def _middle(members: FloatArray, decimals: int) -> tuple[float, ...]:
    """Return the point of (k, 3) that is nearest to their mean, rounded."""
    distance = np.linalg.norm(members - members.mean(axis=0), axis=1)
    # Adding zero makes 0 of −0.
    return tuple((members[np.argmin(distance)].round(decimals) + 0.0).tolist())
