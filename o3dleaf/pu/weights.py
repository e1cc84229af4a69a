"""Wendland's compactly supported weight and its slope; Shepard's normalisation is done where they are summed."""

from numba import njit


@njit(nogil=True, cache=True)
def wendland(tau: float) -> float:
    """Return w(τ) = (1 − τ)⁴ (4τ + 1) for τ < 1, else 0 (Wendland 1995, C² in up to three dimensions)."""
    if tau >= 1.0:
        return 0.0
    rest = 1.0 - tau
    return rest * rest * rest * rest * (4.0 * tau + 1.0)


@njit(nogil=True, cache=True)
def wendland_slope_over_tau(tau: float) -> float:
    """Return w′(τ)/τ = −20 (1 − τ)³ for τ < 1, else 0: finite at the ball's centre, where τ is 0."""
    if tau >= 1.0:
        return 0.0
    rest = 1.0 - tau
    return -20.0 * rest * rest * rest
