"""Newton's method down the energy of a chart, to where it rests."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import look_for_stop
from o3dleaf.leaf.chart.flattening.elimination import factorize
from o3dleaf.leaf.chart.flattening.rigid_energy import RigidEnergy

MAX_STEPS = 200
"""Ten to thirty are usual."""
AT_REST = 1e-12
"""Share of the energy by which the last step promises to lower it, at most."""
UNSEEN = 1e-20
"""Or that fall itself: lengths change by 1e-10 then, root mean square."""
SUFFICIENT = 1e-4
"""Share of the fall that a step promises at its start which it must keep (Armijo 1966)."""
SHORTEST = 1e-10
"""Share of a step that is tried last: what falls no more along it is at rest but for rounding."""
SHIFT = 1e-13
"""Of the Hessian's diagonal, added to it, so that what hangs on a single vertex has a place, too."""


def descend_to_rest(energy: RigidEnergy, chart: FloatArray) -> FloatArray:
    """Return the (n, 2) chart at rest of an energy, found from another one.

    A long leaf bends in the plane for next to nothing: what is left to fall is a millionth where its end has a
    millimeter to go. So a place along the way depends on how it was stopped, but not the rest itself.
    """
    value = energy(chart)
    for _ in range(MAX_STEPS):
        look_for_stop()
        slope = energy.gradient(chart)
        step = _step(energy, chart, slope)
        fall = -float(np.vdot(slope, step))
        if fall <= max(AT_REST * value, UNSEEN):
            # The last one is taken whole: so small a fall is lost in the energy's own rounding.
            return chart + step
        share = 1.0
        while (moved := energy(chart + share * step)) > value - SUFFICIENT * share * fall:
            share /= 2
            if share < SHORTEST:
                return chart
        chart, value = chart + share * step, moved
    return chart


def _step(energy: RigidEnergy, chart: FloatArray, slope: FloatArray) -> FloatArray:
    """Return Newton's step (n, 2); where the energy curves down, that of what it is without."""
    pattern, held = energy.pattern, _held(chart, energy.used)[energy.pattern.unknowns]
    for convex in (False, True):
        factors = factorize(pattern.hold(energy.hessian(chart, convex=convex), held, SHIFT))
        if convex or (factors.U.diagonal() > 0).all():
            break
    step = np.zeros(slope.size)
    step[pattern.unknowns] = factors.solve(np.where(held, 0.0, -slope.ravel()[pattern.unknowns]))
    return step.reshape(-1, 2)


def _held(chart: FloatArray, used: IntArray) -> BoolArray:
    """Return which unknowns (2n,) are held so that the chart can neither be shifted nor turned; u before v of each."""
    first = used[0]
    away = chart - chart[first]
    turned = used[np.argmax(np.hypot(*away[used].T))]
    across = 0 if abs(away[turned, 1]) > abs(away[turned, 0]) else 1
    held = np.ones(chart.shape, bool)
    held[used] = False
    held[first] = held[turned, across] = True
    return held.ravel()
