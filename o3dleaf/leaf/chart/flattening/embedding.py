"""Maps of a sheet to the plane: conformal, convex, and relaxed to keep lengths (libigl's)."""

from collections.abc import Callable

import igl
import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.core.parallel import look_for_stop
from o3dleaf.leaf.chart.flattening.newton_descent import descend_to_rest
from o3dleaf.leaf.chart.flattening.rigid_energy import RigidEnergy
from o3dleaf.leaf.chart.flattening.sheet_shape import BoundaryRings, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas

STEPS = 2000
"""As rigid as possible, at most; accelerated, thirty to two hundred are usual."""
SAFE_ROUNDS = 30
"""Of ten steps without flips, at most."""
AT_REST = 1e-4
"""Share by which the energy may still fall in ten steps when the chart is taken to rest."""
UNSEEN = 1e-9
"""Or the fall itself: lengths change by 3e-5 then, root mean square. Below it the charts of flat leaves creep."""

HOLD = 1e5
"""Stiffness of the place of a vertex that is held."""


def conformal_chart(vertices: FloatArray, triangles: IntArray, rings: BoundaryRings) -> FloatArray | None:
    """Return the (n, 2) least-squares conformal map, of the sheet's area; None where it has no solution."""
    rim = rim_first(rings)[0]
    start = rim[np.argmax(np.linalg.norm(vertices[rim] - vertices[rim].mean(axis=0), axis=1))]
    end = rim[np.argmax(np.linalg.norm(vertices[rim] - vertices[start], axis=1))]
    apart = float(np.linalg.norm(vertices[end] - vertices[start]))
    try:
        chart, _ = igl.lscm(vertices, triangles, np.array([start, end]), np.array([[0.0, 0.0], [apart, 0.0]]))
    except RuntimeError:
        return None
    chart = np.ascontiguousarray(chart)
    return _of_its_area(vertices, triangles, chart) if np.isfinite(chart).all() else None


def convex_chart(vertices: FloatArray, triangles: IntArray, rings: BoundaryRings) -> FloatArray:
    """Return the (n, 2) map whose rim is a circle and whose vertices are means of their neighbors: no flips.

    Tutte 1963 (Proc. LMS 13:743); holes are closed by a vertex in their middle, so that the theorem applies.
    """
    rim, *holes = rim_first(rings)
    count = len(vertices) + len(holes)
    fans = [np.stack([np.roll(h, -1), h, np.full(len(h), len(vertices) + k)], axis=1) for k, h in enumerate(holes)]
    closed = np.concatenate([triangles, *fans])
    ends = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]]).T
    links = scipy.sparse.coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(count, count)).tocsr()
    links = ((links + links.T) > 0).astype(np.float64)
    laplacian = (scipy.sparse.diags_array(np.asarray(links.sum(axis=1)).ravel()) - links).tocsr()
    step = np.linalg.norm(vertices[rim] - np.roll(vertices[rim], 1, axis=0), axis=1)
    angle = 2 * np.pi * np.cumsum(step) / step.sum()
    chart = np.zeros((count, 2))
    chart[rim] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    used = np.unique(closed)
    free = used[~np.isin(used, rim)]
    if len(free):
        solve = scipy.sparse.linalg.splu(laplacian[free][:, free].tocsc()).solve
        chart[free] = solve(-(laplacian[free][:, rim] @ chart[rim]))
    if chart_areas(chart, triangles).sum() < 0:
        chart[:, 0] *= -1
    return _of_its_area(vertices, triangles, chart[: len(vertices)])


def relax_rigidly(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> FloatArray:
    """Return the (n, 2) chart at rest of the energy that is as rigid as possible; a triangle may be flipped.

    That of Liu et al. 2008 (CGF 27:1495), by Newton's method.
    """
    return descend_to_rest(RigidEnergy(vertices, triangles), chart)


def relax_without_flips(
    vertices: FloatArray, triangles: IntArray, chart: FloatArray, rounds: int = SAFE_ROUNDS
) -> FloatArray:
    """Return the (n, 2) chart at rest of the symmetric Dirichlet energy, which no flipped triangle can have.

    Rabinovich et al. 2017 (ACM TOG 36:16), from a chart without flips; after so many `rounds` of ten steps where it
    does not come to rest before.
    """
    step = flip_free_descent(vertices, triangles, chart)
    before, energy_of = np.inf, RigidEnergy(vertices, triangles)
    for _ in range(rounds):
        look_for_stop()
        chart = step(10)
        energy = energy_of(chart)
        if abs(before - energy) <= AT_REST * energy:
            break
        before = energy
    return chart


def flip_free_descent(
    vertices: FloatArray, triangles: IntArray, chart: FloatArray, held: IntArray | None = None
) -> Callable[[int], FloatArray]:
    """Return what takes so many steps down the symmetric Dirichlet energy, from a chart without flips, and returns it.

    Vertices that are `held` (k,) stay where they are but for a part in about `HOLD`: stiffnesses of triangles are about
    1, whatever the unit.
    """
    fixed = np.empty(0, np.int32) if held is None else held.astype(np.int32)
    data = igl.slim_precompute(
        np.asfortranarray(vertices),
        np.asfortranarray(triangles.astype(np.int32)),
        np.asfortranarray(chart),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        fixed,
        np.asfortranarray(chart[fixed]),
        0.0 if held is None else HOLD,
    )
    return lambda steps: np.ascontiguousarray(igl.slim_solve(data, steps))


def _of_its_area(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> FloatArray:
    """Return a chart scaled to the area of its sheet."""
    area = np.abs(chart_areas(chart, triangles)).sum()
    return np.asarray(chart * np.sqrt(triangle_areas(vertices, triangles).sum() / area))
