"""Two leaves of a sheet that lie on one another or cross: whose its points are, and what is said of them."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.mesh_arrays import IntArray

FEWEST = 24
"""Points of the lesser leaf on a sheet from which on they are told."""


class LeafPair(NamedTuple):
    """Rows (k,) of a scan on either leaf, none if they are not told apart, a line on them, and how far they touch.

    The last is the length in spacings of the line along which they were parted, 0 where nothing joined them.
    """

    parts: tuple[IntArray, ...]
    said: str
    length: float = 0.0

    def spread(self, nearest: IntArray, pool: IntArray) -> "LeafPair":
        """Return the same of more points `pool` (m,), each of which goes with the `nearest` (m,) of those used."""
        return self._replace(parts=tuple(pool[np.isin(nearest, leaf)] for leaf in self.parts))

    def tell(self, held: IntArray, pieces: str) -> str:
        """Return a line on what lies on what, how much of a sheet that holds some rows (k,) is the other one's."""
        if not self.parts:
            return f"{self.said}, and touch over so much that nothing shows which points are whose: cut them apart"
        lesser = min(len(np.intersect1d(held, leaf)) for leaf in self.parts)
        joined = f": taken as one sheet, with {lesser:,} points of the lesser" if lesser >= FEWEST else ""
        return f"{self.said}{joined}; `piece` takes one of {pieces}"
