"""The box around a droplet: how wide and high, how many cells, and where the droplet starts."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.output.droplet.units import Impact

RIM = 0.04e-3
"""Meters of the surface that stay outside the box on each side: snapping needs some, and its rim is not straight."""
GAP = 2.0
"""Cells between the droplet and the highest point below it, at the start."""
ROOM = 2.5
"""Height of the box, in diameters, at least."""
REBOUND = 0.75
"""Diameters of air above the droplet at the start, at least."""
BELOW = 2.0
"""Cells between the lowest point of the face and the bottom of the box."""
MAX_CELLS = 4e6
"""More is a typing error in a size, or takes weeks."""


@dataclass(frozen=True)
class DropletBox:
    """The box around a droplet and its cells, in meters, in the frame of the impact.

    Attributes
    ----------
    cell : float
    half : float
        Half its width.
    bottom : float
    cells : (int, int, int)
    start : float
        Height of the droplet's middle at the start.
    """

    cell: float
    half: float
    bottom: float
    cells: tuple[int, int, int]
    start: float

    @classmethod
    def around(cls, vertices: FloatArray, impact: Impact, size: float, cell: float) -> "DropletBox":
        """Return the box over the (n, 3) points of a face, `size` wide, for a droplet in the middle above it.

        Raises
        ------
        InputError
            If the droplet does not fit into it, or there would be too many cells.
        """
        radius = impact.diameter / 2
        across = int((size - 2 * RIM) / cell + 1e-9)
        half = across * cell / 2
        if half < 1.5 * radius:
            raise InputError(
                f"size: {size * 1e3:g} mm is too narrow for a droplet of {impact.diameter * 1e3:g} mm that spreads; "
                f"give at least {3 * radius * 1e3 + 2 * RIM * 1e3 + cell * 1e3:.3g}"
            )
        inside = (np.abs(vertices[:, :2]) <= half).all(axis=1)
        away = np.hypot(*vertices[:, :2].T)
        under = away < radius
        touching = vertices[under, 2] + np.sqrt(radius**2 - away[under] ** 2)
        start = float(touching.max(initial=radius)) + GAP * cell
        bottom = float(np.floor(vertices[inside, 2].min() / cell - BELOW)) * cell
        high = max(ROOM * impact.diameter, start + radius + REBOUND * impact.diameter - bottom)
        up = int(np.ceil(high / cell - 1e-9))
        if across**2 * up > MAX_CELLS:
            raise InputError(f"cell: {cell * 1e3:g} mm makes {across**2 * up:,} cells; give a larger one")
        return cls(cell, half, bottom, (across, across, up), start)

    @property
    def top(self) -> float:
        """Height of the box's top."""
        return self.bottom + self.cells[2] * self.cell
