"""Strips along a margin that bend off the blade inside them: what hangs from the edge of a leaf and is none of it."""

from typing import NamedTuple

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import tell_share
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.residuals.off_blade import points_on
from o3dleaf.leaf.residuals.places import Place, find_places, tell_places

MIN_BEND = np.radians(45.0)
"""Angle by which a strip bends off: a blade is half turned there to the beam, along which false points lie."""
WITHIN = 3
"""Spacings over which it does: a fit follows a sharp edge no closer."""
MAX_WIDTH = 6
"""Spacings from the margin within which the bend begins: beyond, a scan has what bends as a part of its own."""
START = 0.25
"""Spacings from the margin at which normals are first asked for."""
MAX_STATIONS = 2000
"""Places along the margin, at most: some hundred tell shares of its length to a few hundredths."""
MAX_BENT = 0.25
"""Share of the margin's length above which it is told: real leaves roll or fold so tightly along a sixth of theirs."""


class BentMargin(NamedTuple):
    """Strips along a margin that bend off the blade: their shares of its length and of the area, and their places."""

    length: float
    area: float
    places: tuple[Place, ...]

    @property
    def warnings(self) -> list[str]:
        """A line on how much bends off and where, if that is more than of leaves."""
        if self.length <= MAX_BENT:
            return []
        how = f"{100 * self.length:.0f} % of the margin a strip, {tell_share(self.area)} of the area in all"
        why = "margins rolled tightly, or points that a scanner sees between an edge and what is behind it"
        bend = f"{np.degrees(MIN_BEND):.0f}°"
        where = tell_places(self.places)
        return [f"along {how}, bends off the blade by more than {bend}, {where}: {why}; cut those out of the scan"]


def find_bent_margin(blade: Blade, spacing: float) -> BentMargin:
    """Return the strips along the margin of a blade over which its normal turns by more than `MIN_BEND`.

    Parameters
    ----------
    blade : Blade
    spacing : float
        Of the scan's points.
    """
    stations, inward, step = _stations(blade.outline.polygon, spacing)
    depths = START + np.arange(MAX_WIDTH + WITHIN + 1.0)
    places = stations + spacing * depths[:, np.newaxis, np.newaxis] * inward
    inside = blade.outline.contains(places.reshape(-1, 2)).reshape(places.shape[:2])
    inside = np.logical_and.accumulate(inside)
    normals = np.zeros((*inside.shape, 3))
    normals[inside] = _normals(blade, places[inside])
    turned = np.where(inside[WITHIN:], np.einsum("dni,dni->dn", normals[:-WITHIN], normals[WITHIN:]), 1.0)
    bent = turned.min(axis=0) < np.cos(MIN_BEND)
    widths = spacing * (depths[turned.argmin(axis=0)] + WITHIN / 2)
    share = min(float(step * widths[bent].sum() / blade.outline.area), 1.0)
    return BentMargin(float(bent.mean()), share, find_places(points_on(blade, stations), bent, max(spacing, step)))


def _stations(area: shapely.Polygon, spacing: float) -> tuple[FloatArray, FloatArray, float]:
    """Return places (n, 2) along the rings of an area, about a spacing apart, directions inward, and their distance."""
    rings = [ring for ring in shapely.get_rings(shapely.orient_polygons(area)) if ring.length > 0]
    step = max(spacing, sum(ring.length for ring in rings) / MAX_STATIONS)
    places, inward = [], []
    for ring in rings:
        count = max(round(ring.length / step), 3)
        along = (np.arange(count) + 0.5) * ring.length / count
        behind, here, ahead = (
            shapely.get_coordinates(shapely.line_interpolate_point(ring, (along + shift) % ring.length))
            for shift in (-spacing, 0.0, spacing)
        )
        way = ahead - behind
        places.append(here)
        inward.append(np.stack([-way[:, 1], way[:, 0]], axis=1) / _sizes(way))
    return np.concatenate(places), np.concatenate(inward), step


def _normals(blade: Blade, plane: FloatArray) -> FloatArray:
    """Return the unit normals of a blade (n, 3) at (n, 2) places."""
    columns = blade.lift_with_jacobian(np.column_stack([plane, np.zeros(len(plane))])).columns
    cross = np.cross(columns[:, 0], columns[:, 1])
    return np.asarray(cross / _sizes(cross))


def _sizes(vectors: FloatArray) -> FloatArray:
    """Return the lengths (n, 1) of vectors, 1 for those without any."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(size > 0, size, 1.0)
