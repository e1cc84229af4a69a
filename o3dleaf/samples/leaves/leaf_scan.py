"""Scans of leaves of known shape: how the points are spread, noise, gaps, and passes that disagree."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import open3d as o3d
import shapely
from shapely import affinity
from shapely.geometry import MultiPolygon, Point, Polygon, box

from o3dleaf.core.arguments.allowed import Allowed, is_whole
from o3dleaf.core.arguments.checked import checked, require_known
from o3dleaf.core.arguments.kinds import NotNegative, Positive, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.plane_mesh import integrate

STEPS = {"lines": (2.0, 0.5), "stripes": (4.0, 0.25), "grid": (1.0, 1.0)}
"""Of patterns that are even in the chart, in spacings: along the leaf, and across it."""
TURNS = {"lines": 0.0, "stripes": 0.0, "grid": np.radians(20.0)}
PATTERNS = ("random", *STEPS)
DIRECTIONS = ("any", "normal")
GAPS = ("none", "patches", "band", "margin")
PATCHES = 8
PATCH = 2.0
"""Radius of a missing patch, in spacings: less than any hole that a leaf is known to have."""
BAND = 4.0
"""Width of a missing band across the leaf, in spacings."""
HIDDEN = 40.0
"""Length over which a margin is hidden, in millimeters; a third of the leaf at most."""
DEPTH = 0.4
"""What is hidden of that half of the leaf, as a share of its width."""
MAX_PASSES = 1000
Passes = Annotated[int, Allowed(lambda value: is_whole(value) and 1 <= value <= MAX_PASSES, "1 to 1000 passes")]
FLYING = 1.0
"""Flying points to a spacing of the margin: a scanner has as many rays there."""
RING_STEP = 0.1
JITTER = 0.1
"""Of the places of rows and grids, in spacings."""


class LeafScan(NamedTuple):
    """A scan of a leaf of known shape.

    The cloud; the (k, 2) places (u, v) of its first k points, those of the blade, before noise; its spacing
    1/√density and the deviation of its noise in millimeters; what gaps hide, in (u, v); the truth.
    """

    cloud: o3d.geometry.PointCloud
    places: FloatArray
    spacing: float
    noise: float
    hidden: MultiPolygon
    truth: LeafShape

    def __repr__(self) -> str:
        return f"LeafScan({len(self.cloud.points):,} points, spacing {self.spacing:.3g} mm, truth {self.truth!r})"

    @property
    def points(self) -> FloatArray:
        """The (n, 3) points, in millimeters."""
        return np.array(self.cloud.points)

    @property
    def hidden_share(self) -> float:
        """Part of the leaf's area that lies in gaps."""
        parts = [part for part in shapely.get_parts(self.hidden) if not part.is_empty]
        step = 0.25 * self.truth.sweep.length / 60
        return sum(integrate(part, self.truth.stretch, step) for part in parts) / self.truth.area


@checked
@dataclass(frozen=True, kw_only=True)
class Scanning:
    """The settings of a scan of a leaf; lengths but `spacing` are in spacings.

    Attributes
    ----------
    spacing : float
        1/√density of the points, of all passes together, in millimeters.
    pattern : {"random", "lines", "stripes", "grid"}
        Independent points, uniform by area; rows across the leaf two spacings apart with two points a
        spacing, and four apart with four; a square grid, turned by 20°. All but the first are even in (u, v).
    noise : float
        Standard deviation along each axis.
    direction : {"any", "normal"}
        Of the noise of the blade's points: any, or along the leaf's normal alone, as where a scanner looks down
        on it.
    gaps : {"none", "patches", "band", "margin"}
        What nothing is seen of: eight discs of two spacings' radius; a band of four spacings across the leaf;
        two fifths of the upper half over 40 mm of its length (over a third of a shorter one than 120 mm).
    passes : int
        Points are shared among them; each but the first is displaced as a whole.
    offset : float, optional
        By how much; by default the noise's deviation.
    flying : float
        Depth behind the margin, along the beam, over which lie points that a scanner sees between the edge of a leaf
        and what is behind it, one to a spacing of the margin; 0: none. The beam meets the middle at right angles.
    seed : int
    """

    spacing: Positive = 0.6
    pattern: str = "random"
    noise: NotNegative = 0.0
    direction: str = "any"
    gaps: str = "none"
    passes: Passes = 1
    offset: NotNegative | None = None
    flying: NotNegative = 0.0
    seed: Whole = 0

    def __post_init__(self) -> None:
        require_choice(self.pattern, PATTERNS, "pattern")
        require_choice(self.direction, DIRECTIONS, "direction")
        require_choice(self.gaps, GAPS, "gaps")


@checked
def scan_leaf(leaf: LeafShape, **options: Any) -> LeafScan:
    """Return a scan of a leaf of known shape.

    Parameters
    ----------
    leaf : LeafShape
    **options
        Those of `Scanning`: spacing, pattern, noise, direction, gaps, passes, offset, flying, seed.

    Returns
    -------
    LeafScan

    Raises
    ------
    InputError
        If an option is not one of those that there are, or the leaf is too small for two points.
    """
    require_known(options, Scanning)
    how = Scanning(**options)
    _require_resources(leaf, how)
    place_rng, gap_rng, noise_rng, extra_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence(how.seed).spawn(4)
    )
    places = draw_places(leaf, how.spacing, how.pattern, place_rng)
    hidden = hide(leaf, how.gaps, how.spacing, gap_rng)
    places = places[~shapely.contains_xy(hidden, places)]
    if len(places) < 2:
        raise InputError(f"spacing: {how.spacing:g} mm leaves {len(places)} points of the leaf; give a smaller one")
    beside = _extras(leaf, how.spacing, extra_rng), _flying(leaf, how.spacing, how.flying, extra_rng)
    points = np.concatenate([leaf.lift(places), *beside])
    offset = how.noise if how.offset is None else how.offset
    number = noise_rng.integers(0, how.passes, len(points))
    ways = noise_rng.normal(size=(how.passes, 3))
    ways *= offset * how.spacing / np.linalg.norm(ways, axis=1)[:, np.newaxis]
    ways[0] = 0.0
    errors = noise_rng.normal(0.0, how.noise * how.spacing, points.shape)
    if how.direction == "normal":
        errors[: len(places)] = errors[: len(places), :1] * leaf.normals(places)
    points = points + ways[number] + errors
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    return LeafScan(cloud, places, how.spacing, how.noise * how.spacing, hidden, leaf)


def _require_resources(leaf: LeafShape, how: Scanning) -> None:
    """Raise `MemoryBudgetError` if a scan has more points, or the lattice that they lie on, than memory is there."""
    with np.errstate(over="ignore"):
        points, places = np.array(
            [leaf.area, np.sum(np.square(np.ptp(np.reshape(leaf.outline.bounds, (2, 2)), axis=0)))]
        ) / (np.square(np.float64(how.spacing)))
    random = how.pattern == "random"
    cost = measured.DRAWN_POINT * float(points) if random else measured.PLACE * float(places)
    what = f"scan_leaf: about {in_words(points)} points"
    require_resources(cost, what, "give a larger spacing", step=how.spacing)


def draw_places(leaf: LeafShape, spacing: float, pattern: str, rng: np.random.Generator) -> FloatArray:
    """Return the places (n, 2) of a leaf's points in its outline."""
    if pattern == "random":
        return _uniform(leaf, leaf.outline, round(leaf.area / spacing**2), rng)
    steps, angle = spacing * np.array(STEPS[pattern]), TURNS[pattern]
    low, high = np.reshape(leaf.outline.bounds, (2, 2))
    middle, reach = (low + high) / 2, np.linalg.norm(high - low) / 2
    axes = (np.arange(-reach, reach, step) for step in steps)
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2) + rng.uniform(0, spacing, 2)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    places = middle + lattice @ turn.T + rng.normal(0.0, JITTER * spacing, lattice.shape)
    return np.asarray(places[leaf.contains(places)])


def hide(leaf: LeafShape, gaps: str, spacing: float, rng: np.random.Generator) -> MultiPolygon:
    """Return what is hidden of a leaf, in (u, v)."""
    low, high = np.reshape(leaf.outline.bounds, (2, 2))
    shapes: list[Polygon] = []
    if gaps == "patches":
        inner = leaf.outline.buffer(-1.5 * PATCH * spacing)
        room = leaf.outline if inner.is_empty else inner
        shapes = [Point(*place).buffer(PATCH * spacing) for place in _uniform(leaf, room, PATCHES, rng)]
    elif gaps == "band":
        middle = low[0] + rng.uniform(0.35, 0.65) * (high[0] - low[0])
        half = 0.5 * BAND * spacing
        shapes = [box(middle - half, low[1] - 1, middle + half, high[1] + 1)]
    elif gaps == "margin":
        half = 0.5 * min(HIDDEN, (high[0] - low[0]) / 3)
        middle = low[0] + rng.uniform(0.4, 0.55) * (high[0] - low[0])
        # The leaf drawn together across by so much leaves the part beside its margin.
        rest = affinity.scale(leaf.outline, 1.0, 1 - DEPTH, origin=(0.0, 0.0))
        shapes = [box(middle - half, 0.0, middle + half, high[1] + 1).difference(Polygon(rest.exterior))]
    seen = shapely.union_all(shapes).intersection(leaf.outline)
    parts = [part for part in shapely.get_parts(seen) if part.geom_type == "Polygon"]
    return MultiPolygon(parts)


def _uniform(leaf: LeafShape, polygon: Polygon, count: int, rng: np.random.Generator) -> FloatArray:
    """Return (count, 2) places in a polygon, uniform by area on the surface and independent."""
    low, high = np.reshape(polygon.bounds, (2, 2))
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 60).T), axis=-1).reshape(-1, 2)
    most = 1.02 * leaf.stretch(grid).max()
    places = np.empty((0, 2))
    while len(places) < count:
        tried = rng.uniform(low, high, (4 * count + 100, 2))
        level = rng.random(len(tried)) * most
        tried, level = (values[shapely.contains_xy(polygon, tried)] for values in (tried, level))
        places = np.concatenate([places, tried[level < leaf.stretch(tried)]])
    return places[:count]


def _extras(leaf: LeafShape, spacing: float, rng: np.random.Generator) -> FloatArray:
    """Return the points (n, 3) of what is no blade: tubes and a second layer."""
    parts = [tube.draw(round(tube.area / spacing**2), rng) for tube in leaf.tubes]
    if leaf.layer is not None:
        count = round(integrate(leaf.layer, leaf.stretch, 1.0) / spacing**2)
        places = _uniform(leaf, leaf.layer, count, rng)
        parts.append(leaf.lift(places) + leaf.layer_height * leaf.normals(places))
    return np.concatenate([np.empty((0, 3)), *parts])


def _flying(leaf: LeafShape, spacing: float, depth: float, rng: np.random.Generator) -> FloatArray:
    """Return points (n, 3) behind the margin, even along it and over a depth in spacings."""
    if depth == 0:
        return np.empty((0, 3))
    rings = [leaf.lift(ring) for ring in leaf.margin_places(RING_STEP * spacing)]
    ways = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    length = np.linalg.norm(ways, axis=1)
    count = round(FLYING * length.sum() / spacing)
    row = rng.choice(len(ways), count, p=length / length.sum())
    beam = -leaf.normals(np.mean(np.reshape(leaf.outline.bounds, (2, 2)), axis=0, keepdims=True))
    edge = np.concatenate(rings)[row] + rng.random((count, 1)) * ways[row]
    return np.asarray(edge + spacing * depth * rng.random((count, 1)) * beam)
