"""Detection of the midrib: a principal curve of the scan that keeps midway between the blade's two edges.

The paper picks control points by hand. Here the ends of the leaf are the two points farthest apart
along the scan; slices of equal distance from one end give a first axis; and the axis is then moved,
station by station, to the middle between the edges of the blade until it rests.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.midrib_normals import half_width

NEIGHBORS = 12
SLICES = 40
MIN_ASPECT = 3.0
"""Length over width below which a blade has no midrib to follow: a broad leaf.

The length counts where the leaf is at least half as wide as the blade, so that a petiole makes no leaf long.
"""
MAX_TRIED = 10_000
"""Points that are looked at to see whether they lie in different places."""
MIN_POINTS = 50
MIN_WIDTH = 1e-3
"""Width over length below which a cloud is a line, not a leaf: the midrib would need thousands of stations."""
EDGES = (0.02, 0.98)
"""Quantiles of `across` in a slice that stand for the blade's edges."""
TOLERANCE = 0.02
"""Share of the width that the axis may still move when it has come to rest."""
MAX_ITERATIONS = 12
STIFFNESS = 0.3
"""Of the axis against the middles of stations half a width apart: less follows one hidden edge, more cuts bends."""
MIN_WEIGHT = 0.03
"""Of a station with no points, as a share of the usual density: there the axis goes on smoothly."""


def find_midrib(cloud: CloudLike) -> FloatArray:
    """Return control points (k, 3) of the midrib of an elongated leaf, from base to tip, half a width apart.

    The base is the end whose fifth of the leaf is wider.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Points of one leaf, in any unit.

    Raises
    ------
    InputError
        If there are too few points or one is not finite.
    ReconstructionError
        If the blade is less than `MIN_ASPECT` times as long as wide, its petiole not counted.
    """
    points = points_of(cloud, "cloud", least=MIN_POINTS)
    few = points[:: max(1, len(points) // MAX_TRIED)]
    if len(np.unique(few, axis=0)) < MIN_POINTS:
        raise InputError("midrib: the points lie in a few places only; give the points of a whole leaf")
    control = _first_axis(points)
    length = _length(control)
    width = 2 * half_width(points, control)
    if not width > MIN_WIDTH * length:
        raise InputError("midrib: the points lie on one line or in one place; give the points of a whole leaf")
    if length < MIN_ASPECT * width:
        raise _broad(length, width)
    for _ in range(MAX_ITERATIONS):
        before = _resample(control, width / 2)
        control = _recenter(points, before, width / 2)
        width = 2 * half_width(points, control)
        if _farthest_move(control, before) < TOLERANCE * width:
            break
    if (blade := _blade_length(points, control, width)) < MIN_ASPECT * width:
        raise _broad(blade, width)
    return _from_base(points, control)


def _broad(length: float, width: float) -> ReconstructionError:
    return ReconstructionError(
        f"midrib: the blade is {tell_length(length)} long and {tell_length(width)} wide, not an elongated leaf; "
        "pick control points by hand and give them as the midrib"
    )


def _blade_length(points: FloatArray, control: FloatArray, width: float) -> float:
    """Return the length of the axis along which the leaf is at least half as wide as `width`."""
    along, across, _ = LeafFrame.fit(points, control, radius=width / 2).to_leaf(points).T
    first, length = along.min(), float(np.ptp(along))
    count = min(SLICES, len(points) // (MIN_POINTS // 5))
    slices = np.minimum(((along - first) / length * count).astype(np.int64), count - 1)
    widths = np.array([np.ptp(np.quantile(across[slices == k], EDGES)) for k in np.unique(slices)])
    return length * float(np.sum(widths >= width / 2)) / count


def _farthest_move(control: FloatArray, other: FloatArray) -> float:
    """Return the largest distance from inner control points to the curve through `other`."""
    dense = _resample(other, _length(other) / 2000)
    distance, _ = cKDTree(dense).query(control[1:-1])
    return float(distance.max(initial=0.0))


def _first_axis(points: FloatArray) -> FloatArray:
    """Return the smoothed medians of slices at equal distance along the scan from one of its two far ends."""
    graph = _neighbor_graph(points)
    start = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    for _ in range(3):
        start = int(np.argmax(dijkstra(graph, indices=start)))
    reached = dijkstra(graph, indices=start)
    slices = np.minimum((reached / reached.max() * SLICES).astype(np.int64), SLICES - 1)
    medians = np.array([np.median(points[slices == k], axis=0) for k in np.unique(slices)])
    return _smooth(medians, 1.0)


def _neighbor_graph(points: FloatArray) -> csr_array:
    """Return the graph of nearest neighbors, its components joined by their shortest links."""
    count = len(points)
    distance, row = query(cKDTree(points), points, k=min(NEIGHBORS, count - 1) + 1)
    # A repeated point is at distance 0, which a sparse graph would take for no edge.
    lengths = distance[:, 1:].ravel() + 1e-12 * distance.max()
    links = (np.repeat(np.arange(count), row.shape[1] - 1), row[:, 1:].ravel())
    graph = coo_array((lengths, links), shape=(count, count)).tocsr()
    while True:
        components, label = connected_components(graph, directed=False)
        if components == 1:
            return graph.maximum(graph.T)
        bridges = []
        for component in range(components):
            inside, outside = np.flatnonzero(label == component), np.flatnonzero(label != component)
            gap, nearest = cKDTree(points[outside]).query(points[inside])
            shortest = int(np.argmin(gap))
            bridges.append((inside[shortest], outside[nearest[shortest]], gap[shortest]))
        a, b, gaps = (np.array(column) for column in zip(*bridges, strict=True))
        graph = graph.maximum(coo_array((gaps, (a, b)), shape=(count, count)).tocsr())


def _recenter(points: FloatArray, control: FloatArray, reach: float) -> FloatArray:
    """Return the control points moved midway between the blade's edges, smoothed, and ending where the scan ends."""
    frame = LeafFrame.fit(points, control, radius=reach)
    leaf = frame.to_leaf(points)
    targets = np.column_stack([frame.breaks, np.zeros((len(frame.breaks), 2))])
    density = np.zeros(len(targets))
    for station, t in enumerate(frame.breaks):
        near = leaf[np.abs(leaf[:, 0] - t) < reach]
        if len(near) < MIN_POINTS // 10:
            continue
        edges = np.quantile(near[:, 1], EDGES)
        middle, area = edges.mean(), np.ptp(edges) * np.ptp(near[:, 0])
        density[station] = len(near) / area if area > 0 else 0.0
        close = near[np.argsort(np.abs(near[:, 1] - middle), kind="stable")[: max(5, len(near) // 3)]]
        targets[station, 1:] = middle, np.median(close[:, 2])
    # The outermost of n points is about width/n short of the edge: an error that falls with their density.
    usual = np.median(density) or density.max() or 1.0
    weights = np.clip(density / usual, MIN_WEIGHT, 1.0) ** 2
    moved = _smooth(frame.to_world(targets), STIFFNESS, weights)
    axis = LeafFrame.fit(points, moved, radius=reach)
    along = axis.to_leaf(points)[:, 0]
    inner = axis.breaks[(axis.breaks > along.min() + 0.3 * reach) & (axis.breaks < along.max() - 0.3 * reach)]
    return axis.stations(np.concatenate([[along.min()], inner, [along.max()]]))[0]


def _from_base(points: FloatArray, control: FloatArray) -> FloatArray:
    """Return the control points in the order that begins at the wider end."""
    frame = LeafFrame.fit(points, control)
    leaf = frame.to_leaf(points)
    ends = leaf[:, 0] < 0.2 * frame.length, leaf[:, 0] > 0.8 * frame.length
    first, last = (float(np.ptp(np.quantile(leaf[end, 1], (0.05, 0.95)))) if end.any() else 0.0 for end in ends)
    return control if first >= last else control[::-1].copy()


def _length(control: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(control, axis=0), axis=1).sum())


def _resample(control: FloatArray, step: float) -> FloatArray:
    """Return points about `step` apart on the cubic spline through the control points."""
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(control, axis=0), axis=1))])
    count = max(4, round(reached[-1] / step))
    return np.asarray(CubicSpline(reached, control)(np.linspace(0, reached[-1], count + 1)))


def _smooth(control: FloatArray, smoothing: float, weights: FloatArray | None = None) -> FloatArray:
    """Return (W + μ DᵀD)⁻¹ W c, D the second differences: a polyline that bends less (Whittaker 1923)."""
    weight = np.eye(len(control)) if weights is None else np.diag(weights)
    difference = np.diff(np.eye(len(control)), 2, axis=0)
    return np.asarray(
        np.linalg.solve(weight + smoothing * difference.T @ difference, weight @ control), dtype=np.float64
    )
