"""The compiled loop over points beside a stalk, and the margins of a blade that are tried for them."""

import math

from o3dleaf.core.compiled.decorator import njit

CERTAIN = 9.0
"""Deviations off a margin from which on a point is inside or outside it but for rounding."""


@njit(nogil=True, cache=True)
def add_margin_costs(at, beside, fringe, places, slopes, jumps, density, soft, stray, cost):
    """Add −log likelihoods of points (n,) to the `cost` (k, m, a) of margins from `places`, with slopes and jumps.

    A point's likelihood is density times Φ of its distance inside the margin in deviations `soft`, and that of what
    fits nothing, `stray`, and of the stalk's own points, `fringe` (n,).
    """
    for i in range(at.size):
        outside = math.log(density * stray + fringe[i])
        inside = math.log(density * (1.0 + stray) + fringe[i])
        for k in range(places.size):
            ahead = at[i] - places[k]
            for m in range(slopes.size):
                scale = 1.0 / math.sqrt(1.0 + slopes[m] * slopes[m])
                reach = slopes[m] * ahead - beside[i]
                for a in range(jumps.size):
                    z = min((jumps[a] + reach) * scale, ahead) / soft
                    if z <= -CERTAIN:
                        cost[k, m, a] -= outside
                    elif z >= CERTAIN:
                        cost[k, m, a] -= inside
                    else:
                        share = 0.5 * math.erfc(-z / math.sqrt(2.0)) + stray
                        cost[k, m, a] -= math.log(density * share + fringe[i])
