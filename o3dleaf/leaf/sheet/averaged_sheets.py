"""The sheets of a scan, averaged by its noise, and as wide as it takes where layers lie close together."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.layers.parting import other_layers
from o3dleaf.leaf.sheet.layers.widths import LINK, MEETING, STEEP, Layers, find_layers, find_passes, noise_width, widen
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, nearest_layers
from o3dleaf.leaf.sheet.pieces.leaf_pair import LeafPair
from o3dleaf.leaf.sheet.pieces.resting import Resting, find_resting
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

FEWEST = 24
"""Points of a sheet at least, as `detect_outliers` has it."""
ROUNDS = 6
"""Times that a cloud is averaged anew at most, each time where the sheet before it lay double."""
THICK = 25.0
"""Spacings up to which the two sides of a closed surface are taken for those of a thin leaf."""
FLAT = 0.75
"""Mean thickness over the median distance between the sides of a thin leaf at least: 0.76 of an elliptic section three
times as wide as high, 0.66 of one twice as wide, 0.5 of a cylinder."""
SAMPLE = 400
"""Vertices at which the thickness of a closed surface is measured."""
FEWEST_CONTACTS = 8
"""Places where a rim touches another part at least, for sheets to branch there."""


class AveragedSheets(NamedTuple):
    """Sheets at widths (n,), which exceed `base` where layers were averaged, rows (n,) of a scan, and other layers'.

    Leaves that rest on one another are rows of the scan, too.
    """

    sheets: OpenSheets
    width: FloatArray
    base: float
    rows: IntArray
    others: IntArray = np.empty(0, np.int64)
    resting: LeafPair | None = None


def average_to_sheets(scan: FloatArray, some: IntArray, *, one_sheet: bool) -> AveragedSheets:
    """Return the sheets of points of a scan, averaged by noise and where layers lie."""
    cloud = OrientedCloud.of(scan[some])
    if cloud.surfels.scale.full:
        raise ReconstructionError(
            f"scan: its {len(cloud):,} points at {tell_middle(cloud.points, cloud.points)} show no surface: they fill "
            "a volume or lie along lines; give the points of a leaf, with less noise"
        )
    spacing = cloud.spacing
    base = noise_width(cloud.noise, spacing)
    width = np.full(len(cloud), base)
    layers = Layers.none()
    sheets = OpenSheets.of(cloud.points, width, spacing)
    thickness = _thickness(sheets) if sheets.is_closed else 0.0
    is_tube = sheets.is_closed and not np.isfinite(thickness)
    if not one_sheet:
        _refuse_layers(cloud.points, sheets)
        return AveragedSheets(sheets, width, base, some)
    # Thinned until the sides of a thin leaf lie near enough to be averaged.
    fewer = 1 if is_tube else int(np.ceil((thickness / (MEETING * spacing)) ** 2))
    if fewer > 1 and len(some) // fewer >= FEWEST:
        return average_to_sheets(scan, some[thinned(len(some), fewer)], one_sheet=one_sheet)
    resting = Resting() if sheets.is_closed else find_resting(cloud.points, cloud.noise, sheets, some)
    others = resting.fragment
    if not len(others) and base == 0 and len(find_layers(sheets, is_tube=is_tube)[0]) >= FEWEST:
        others = other_layers(cloud.points, spacing, cloud.noise)
    if len(others):
        found = average_to_sheets(scan, np.delete(some, others), one_sheet=one_sheet)
        return found._replace(others=np.append(some[others], found.others), resting=resting.pair or found.resting)
    for round_ in range(ROUNDS):
        after = layers.after(*find_layers(sheets, is_tube=is_tube), LINK * spacing)
        if after.like(layers):
            break
        layers = after
        width = widen(cloud.points, np.full(len(cloud), base), layers)
        sheets = OpenSheets.of(cloud.points, width, spacing)
        progress.report(round_ + 1, ROUNDS)
    return AveragedSheets(_part_branches(cloud.points, width, sheets), width, base, some, resting=resting.pair)


def _part_branches(points: FloatArray, width: FloatArray, sheets: OpenSheets) -> OpenSheets:
    """Return the sheets without vertices near lines where they branch, if one comes off the inside of the largest.

    Beside such a line the planes through the points lie askew; triangles from both sides of it find together.
    """
    contacts = sheets.contacts()
    if len(contacts) < FEWEST_CONTACTS:
        return sheets
    parted = OpenSheets.of(points, width, sheets.spacing, contacts)
    gained = parted.areas[1:].max(initial=0.0) - sheets.areas[1:].max(initial=0.0)
    inside = query(cKDTree(parted.rim()), contacts)[0] > parted.gap
    return parted if gained >= FEWEST * sheets.spacing**2 and 2 * inside.sum() > len(inside) else sheets


def _thickness(sheets: OpenSheets) -> float:
    """Return how far apart the sides of the largest sheet, a closed one, are, inf where it is round rather than flat.

    A solid of volume V and area A is 2 V / A thick on the mean if it is flat; a cylinder is twice as thick as that.
    """
    vertices, triangles = sheets.sheet()
    normals = vertex_normals(vertices, triangles)
    some = thinned(len(vertices), -(-len(vertices) // SAMPLE))
    overlaps = nearest_layers(vertices, normals, THICK * sheets.spacing, STEEP, some)
    apart = float(np.median(np.where(overlaps.facing < 0, overlaps.distance, np.inf).min(axis=1)))
    middle = vertices[triangles] - vertices.mean(axis=0)
    volume = abs(np.linalg.det(middle).sum()) / 6
    return apart if np.isfinite(apart) and 2 * volume >= FLAT * apart * sheets.areas[0] else np.inf


def _refuse_layers(points: FloatArray, sheets: OpenSheets) -> None:
    """Raise `ReconstructionError` where layers lie over the largest sheet."""
    layers = Layers.none().after(*find_layers(sheets), LINK * sheets.spacing)
    passes = find_passes(points, sheets)
    places = np.concatenate([layers.places, passes.places])
    if len(places):
        off = max(passes.apart, layers.need.max(initial=0.0))
        raise ReconstructionError(
            f"scan: is no single sheet: at {len(places)} places, most around {tell_middle(places, points)}, another "
            f"layer lies up to {tell_length(off)} off; allow them to be averaged, or cut them out",
            places,
        )
    if len(sheets.cut):
        raise ReconstructionError(
            f"scan: is no single sheet: parts far apart along it touch at {tell_middle(sheets.cut, points)}; allow "
            "points to be averaged into one sheet, or cut them apart there",
            sheets.cut,
        )
