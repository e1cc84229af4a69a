"""The tiled field: one patch of micro-structure repeated over the plane, without copying it (paper, section 2.6)."""

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray
from o3dleaf.errors import InputError
from o3dleaf.pu.blended import Blended
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.interpolant import PUInterpolant
from o3dleaf.store import write_model


@dataclass(frozen=True, init=False, eq=False)
class TiledField(Blended):
    r"""Shifted copies of a partition of unity, blended where they meet by the partition of unity itself.

    .. math:: F(z) = \frac{\sum_i \sum_q w(|z - s^q - c_i|/r_i)\, F_i(z - s^q)}
                          {\sum_i \sum_q w(|z - s^q - c_i|/r_i)}

    the sums over balls i and shifts s^q by whole periods (the equation of G in the paper's section
    2.6; Algorithm 1 prints F_i(z), meaning F_i(z − s)). A query is reduced to one cell, and only the
    images of balls that reach into the cell are looked at; nothing is copied.

    Attributes
    ----------
    field : PUInterpolant
        The patch.
    period : (2,) ndarray
        Size of a tile along the first two axes, in the field's unit.
    cell : (2, d) ndarray
        Box of one tile.
    """

    field: PUInterpolant
    period: FloatArray
    cell: FloatArray
    index: BallIndex

    def __init__(self, field: PUInterpolant, period: npt.ArrayLike | None = None) -> None:
        """Tile `field` with `period` (2,), in its unit; by default the extent of its bounds.

        Raises
        ------
        InputError
            If the period is not positive, or larger than the patch, which would leave gaps.
        """
        extent = field.bounds[1] - field.bounds[0]
        size = extent[:2].copy() if period is None else np.array(period, dtype=np.float64)
        if size.shape != (2,) or not np.all(size > 0):
            raise InputError(f"period: is {period!r}; give two lengths above zero, along and across")
        if np.any(size > extent[:2] * (1 + 1e-12)):
            raise InputError(
                f"period: {size.tolist()} is larger than the patch, {extent[:2].tolist()}; tiles would not meet"
            )
        cell = field.bounds.copy()
        cell[1, :2] = cell[0, :2] + size
        repeat = np.zeros(len(extent))
        repeat[:2] = size
        index = BallIndex.periodic(field.cover.centres, field.cover.radii, cell, repeat)
        parts = {"field": field, "local": field.local, "period": size, "cell": cell, "index": index}
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    def state(self) -> dict[str, Any]:
        """Return what the field is made of, for `o3dleaf.store`."""
        return {"field": self.field, "period": self.period}

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.field.unit

    @property
    def bounds(self) -> FloatArray:
        """(2, d) the domain: all of the plane, and the patch's own extent across it."""
        return self.index.domain

    def save(self, path: str | PathLike[str]) -> None:
        """Write the tiled field as one model file, which `o3dleaf.load` reads."""
        write_model(path, self)
