"""The site of a drop on a leaf: the heights of its adaxial face around a place without hairs."""

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.droplet.frame import ImpactFrame
from o3dleaf.output.droplet.surfaces import LandingWindow
from o3dleaf.output.static_drop.cap import cap_radius
from o3dleaf.output.static_drop.datafile import StaticDrop
from o3dleaf.output.static_drop.ground import CosineSeries

ROOM = 1.6
"""Width of the window, of the larger of the drop and of its base on a plate: it spreads along furrows."""
REACH = 0.55
"""Of the same: what a drop may touch around its middle, half of it and a tenth more."""
STEP = 0.02
"""Millimeters between the heights that are looked up."""
STANDS_OUT = 0.03
"""Millimeters by which what is narrower than a hair stands out of the blade."""
SHORTEST = 0.1
"""Millimeters: half of the shortest wave that the mean surface keeps. Cells are of 0.02 to 0.05, ridges 0.3 apart."""


@checked
def drop_on_leaf(
    leaf: MultiscaleLeaf,
    at: tuple[float, float],
    *,
    angle: Positive = 150.0,
    diameter: Positive = 0.6,
    mean_along: bool = True,
    about: str = "",
) -> StaticDrop:
    """Return a drop on the mean adaxial surface around a place of a leaf, where that is a height over a plane.

    The heights are those of the highest points of the leaf over a window, seen along the normal of the blade at the
    place, and moved into its frame: along is x, across is y, and gravity is along −z, as on a leaf that lies level.
    They are averaged along the leaf, so that ridges stay, and stomata and cells go, or, without `mean_along`, kept with
    all waves longer than 0.2 mm. A height is not the surface where that overhangs: pits below the highest points, such
    as the air behind stomata, are closed by it, and hairs are refused.

    Parameters
    ----------
    leaf : MultiscaleLeaf
        With a unit.
    at : (float, float)
        Place, along and across, in the leaf's unit.
    angle : float
        Contact angle in degrees, 10 to 170.
    diameter : float
        Of a ball of the drop's volume, in millimeters.
    mean_along : bool
    about : str
        A line for the file.

    Raises
    ------
    InputError
        If a hair stands under or beside the drop, the window leaves the blade, or the angle is out of range.
    """
    if not 10 <= angle <= 170:
        raise InputError(f"angle: is {angle:g}; give a contact angle from 10 to 170 degrees")
    if leaf.unit is None:
        raise InputError("leaf: states no unit, and a drop has a size; make the leaf of a scan with a unit")
    unit, bend = unit_scale("mm", leaf.unit), np.radians(angle)
    base = 2 * cap_radius(bend) * np.sin(min(bend, np.pi / 2))
    size = ROOM * max(1.0, base / 2) * diameter * unit
    window = LandingWindow(leaf, at, size, STEP * unit)
    _require_no_hair(window, size * REACH / ROOM, STANDS_OUT * unit)
    points = _surface_points(window)
    sides = np.ptp(points[:, :2], axis=0)
    points -= np.array([*(points[:, :2].min(axis=0) + sides / 2), 0.0])
    along, across = (max(int(side / (SHORTEST * unit)), 1) + 1 for side in sides)
    ground = CosineSeries.fit(points, sides, (1 if mean_along else along, across))
    return StaticDrop(ground.scaled(unit_scale(leaf.unit, "m")), angle, diameter * 1e-3, about=about)


def _require_no_hair(window: LandingWindow, reach: float, height: float) -> None:
    """Raise `InputError` if a hair stands within reach of the place."""
    plane = _places(window)
    apart = np.linalg.norm(plane - window.place, axis=1)
    touched = ((window.top_heights - window.bare_heights).ravel() > height) & (apart < reach)
    if touched.any():
        nearest = np.flatnonzero(touched)[apart[touched].argmin()]
        along, across = plane[nearest]
        raise InputError(
            f"at: a hair stands {apart[nearest]:.2g} {window.leaf.unit} away, at along {along:.4g}, "
            f"across {across:.4g}, and a surface with hairs is no height over a plane; choose a place without, or "
            "--for droplet"
        )


def _surface_points(window: LandingWindow) -> FloatArray:
    """Return points (n, 3) of the surface in the frame of the place; hairs out of reach are taken off."""
    world = window.leaf.blade.lift(np.column_stack([_places(window), window.bare_heights.ravel()]))
    return ImpactFrame.at(window.leaf.blade, window.place).to_local(world)


def _places(window: LandingWindow) -> FloatArray:
    """Return the places (n, 2) of the window's grid."""
    return np.stack(np.meshgrid(*window.grid, indexing="ij"), axis=-1).reshape(-1, 2)
