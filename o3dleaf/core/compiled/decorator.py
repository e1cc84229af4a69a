"""The decorator of every compiled function: Numba's, for a level of processors, with code that comes with the package.

It needs inner parts of Numba, which are known of one version. With another one functions are compiled by Numba as it
comes, for the processor at hand: results can then differ in their last bits from one machine to another.
"""

import numba

KNOWN = "0.68."
"""The beginning of the versions of Numba whose inner parts are known."""

if numba.__version__.startswith(KNOWN):
    from o3dleaf.core.compiled.numba_target import njit
else:
    from numba import njit

__all__ = ["njit"]
