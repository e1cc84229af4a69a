"""Compiled: products of two vectors of space."""

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def dot3(a, b):
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True, cache=True)
def cross3(a, b, out):
    """Write a × b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
