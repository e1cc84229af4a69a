"""Wendland's compactly supported weight and its jets; Shepard's normalization is done where they are summed."""

import math

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def wendland(tau: float) -> float:
    """Return w(τ) = (1 − τ)⁴ (4τ + 1) for τ < 1, else 0 (Wendland 1995, C² in up to three dimensions)."""
    rest = max(1.0 - tau, 0.0)
    return rest * rest * rest * rest * (4.0 * tau + 1.0)


@njit(nogil=True, cache=True)
def wendland_derivative_over_tau(tau: float) -> float:
    """Return w′(τ)/τ = −20 (1 − τ)³ for τ < 1, else 0: finite at the ball's center, where τ is 0."""
    rest = max(1.0 - tau, 0.0)
    return -20.0 * rest * rest * rest


@njit(nogil=True, cache=True)
def weight_jets(z, count, level, jets):
    """Write the jets of w(|z|) at the first `count` columns of the unit coordinates z (d, ·)."""
    dimension = len(z)
    for i in range(count):
        square = 0.0
        for a in range(dimension):
            square += z[a, i] * z[a, i]
        tau = math.sqrt(square)
        jets[0, i] = wendland(tau)
        if level == 0:
            continue
        derivative = wendland_derivative_over_tau(tau)
        for a in range(dimension):
            jets[1 + a, i] = derivative * z[a, i]
        if level == 2:
            rest = max(1.0 - tau, 0.0)
            # (w′/τ)′/τ grows as 1/τ at the center, where z zᵀ falls as τ².
            second = 60.0 * rest * rest / tau if tau > 0.0 else 0.0
            row = 1 + dimension
            for a in range(dimension):
                jets[row, i] = derivative
                for b in range(a, dimension):
                    if b > a:
                        jets[row, i] = 0.0
                    jets[row, i] += second * z[a, i] * z[b, i]
                    row += 1
