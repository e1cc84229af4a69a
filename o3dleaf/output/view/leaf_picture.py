"""The picture of a whole leaf, or of a part of it, with an inset of its micro-structure; and of a scan's pieces."""

from collections.abc import Sequence
from itertools import cycle
from os import PathLike

import numpy as np
import numpy.typing as npt
import open3d as o3d
import shapely
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.places import middle_of
from o3dleaf.core.trees import query
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.sheet.scan_pieces import ScanPieces
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.picture import SUFFIXES, Inset, draw_page, render, save_page
from o3dleaf.output.view.points import Points, make_facets

WINDOW_MM = 2.4
"""Side of the inset's window on the leaf."""
STEPS = 200
"""Mesh steps along that side: half a voxel of a 24 µm CT in 2.4 mm, so that hairs are round."""
SHARE = 0.5
"""Of the shorter side of a part that is drawn alone, the most that the window takes: it is a detail."""
MARK = 0.006
"""Radius of the mark of a place, of the scan's extent: a dot of ten pixels."""
VERMILION = "#d55e00"
COLORS = ("#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of the first pieces, and again of those after them: the color-blind tell them apart, and from marks (Okabe and Ito,
2008)."""
NONE = "#9a9a94"
"""Of points of no piece."""
NUMBERED = 24
"""Pieces whose numbers are written, the largest."""
NAMED = 6
"""Pieces whose size and place is written above the picture."""


def render_leaf(
    leaf: MultiscaleLeaf | Blade,
    mesh: o3d.geometry.TriangleMesh,
    path: str | PathLike[str],
    region: npt.ArrayLike | None = None,
    warnings: Sequence[str] = (),
) -> None:
    """Draw a mesh of a leaf into a file, with an inset of the micro-structure where there is one.

    `region`, (2, 2) lower and upper (along, across), is the part that the mesh shows; None is the whole leaf. What
    is not held of the scan is written above it.
    """
    insets = []
    if isinstance(leaf, MultiscaleLeaf):
        window = inset_window(leaf, region)
        insets = [Inset(leaf.extract_mesh(inset_step(leaf.unit, region), window))]
    render(mesh, path, insets=insets, unit=leaf.unit, title="\n".join(["", *warnings]))


def render_refusal(
    scan: CloudLike, cause: ReconstructionError, path: str | PathLike[str], unit: str | None = None
) -> None:
    """Draw a scan that was refused into a file: its pieces, if the cause names them, marks at its places, its words."""
    points = points_of(scan, "scan", least=3)
    things, labels = draw_pieces(points, cause.pieces)
    if cause.places is not None:
        size = MARK * float(np.ptp(points, axis=0).max())
        # Marks inside the scan are moved toward the eye, and drawn where they are, and in front.
        front = 2 * size * Camera.framing(*make_facets(points), View()).toward
        things.append(Points(as_points(cause.places, "places", dim=3) + front, size, VERMILION))
    subject = Inset(things, unit=unit)
    save_page(draw_page(subject, title=f"\n{cause}", labels=labels), require_writable(path, SUFFIXES))


@checked
def render_pieces(
    pieces: ScanPieces,
    path: str | PathLike[str] | None = None,
    *,
    unit: Unit | None = None,
    size: tuple[int, int] = (1600, 1000),
    view: View | None = None,
    title: str | None = None,
) -> npt.NDArray[np.uint8]:
    """Return a picture of a scan whose pieces have colors and their numbers, and write it if a path is given.

    Parameters
    ----------
    pieces : ScanPieces
        See `find_pieces`.
    path : path-like, optional
        A .png, .jpg, .pdf or .svg file.
    unit : str, optional
        Of the scan, for the scale bar.
    size, view : optional
        See `render`.
    title : str, optional
        Above the picture, instead of number, size and place of the first pieces.

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If the path is no picture's.
    """
    file = None if path is None else require_writable(path, SUFFIXES)
    each = [pieces.points[pieces.number == number] for number in range(1, len(pieces) + 1)]
    things, labels = draw_pieces(pieces.points, each)
    named = "\n".join(["", *pieces.lines[:NAMED]]) if title is None else title
    subject = Inset(things, view=view or View(), unit=unit)
    return save_page(draw_page(subject, size=size, title=named, labels=labels), file)


def draw_pieces(points: FloatArray, pieces: Sequence[FloatArray]) -> tuple[list[Points], list[tuple[FloatArray, str]]]:
    """Return points (n, 3) in the colors of the pieces (k, 3) that some of them are of, and the number of each."""
    radius = Points(points).size(points)
    things = [Points(own, radius, color) for own, color in zip(pieces, cycle(COLORS))]
    rest = points[query(cKDTree(np.concatenate(pieces)), points)[0] > 0] if pieces else points
    if len(rest):
        things.append(Points(rest, radius, NONE if pieces else None))
    labels = [(middle_of(own), str(number)) for number, own in enumerate(pieces[:NUMBERED], 1)]
    return things, labels


def inset_window(leaf: MultiscaleLeaf, region: npt.ArrayLike | None = None) -> FloatArray:
    """Return the (2, 2) window of the inset: 2.4 mm in the middle of what the picture shows of the outline."""
    side, shown = _inset_side(leaf.unit, region), leaf.blade.outline.polygon
    if region is not None:
        shown &= shapely.box(*np.asarray(region, dtype=np.float64).ravel())
    middle = shown.representative_point()
    center = np.array([middle.x, middle.y])
    return np.array([center - side / 2, center + side / 2])


def inset_step(unit: str | None, region: npt.ArrayLike | None = None) -> float:
    """Return the step of the inset's mesh, in the leaf's unit, which does not depend on the blade."""
    return _inset_side(unit, region) / STEPS


def _inset_side(unit: str | None, region: npt.ArrayLike | None) -> float:
    side = WINDOW_MM * unit_scale("mm", unit)
    return side if region is None else min(side, SHARE * float(np.ptp(np.asarray(region), axis=0).min()))
