"""The kinds of leaves of known shape, each with what may be changed of it."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from shapely import affinity

from o3dleaf.core.arguments.checked import checked, require_known
from o3dleaf.core.arguments.kinds import between
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.samples.leaves.leaf_shape import LeafShape, Tube
from o3dleaf.samples.leaves.outlines import eat, lobed_outline, long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep

AXIS_STEP = 0.5
"""Distance of the points of a stalk's axis, in millimeters."""

Millimeters = Annotated[float, between(1, 10_000, "a length of 1 to 10,000 millimeters")]
"""Outlines are drawn with edges of 0.2 mm, whatever their size."""
Gap = Annotated[float, between(0, 10_000, "a length of at most 10,000 millimeters")]
Degrees = Annotated[float, between(-3600, 3600, "an angle of at most ten turns, in degrees")]
Lobes = Annotated[float, between(1, 1000, "a number from 1 to 1000")]
Depth = Annotated[float, between(0, 0.9, "a number from 0 to 0.9")]


@checked
def leaf_shape(kind: str, **parameters: float) -> LeafShape:
    """Return a leaf of known shape; lengths in millimeters, angles in degrees.

    ===========  =============================================================  ================================
    kind         what it is                                                     parameters
    ===========  =============================================================  ================================
    "curled"     both margins curled up by an angle; isometric if arch = 0      length, width, angle, arch
    "twisted"    a strip twisted about its axis: a helicoid                     length, width, angle
    "wavy"       an S in the vertical, bent up and down; isometric              length, width, angle
    "winding"    an S sideways in the leaf's own plane; flat                    length, width, angle
    "eaten"      a hole, notches in the margin; a bent sheet, isometric         length, width, hole, notch, arch
    "lobed"      broad with lobes; a bent sheet, isometric                      length, width, lobes, depth, arch
    "cupped"     a part of a sphere: Gaussian curvature 1/radius²               length, width, radius
    "petiole"    an oval blade on a long round petiole with a stub of the stem  length, width, stalk, stub, arch
    "layers"     a second, small sheet above one side                           length, width, height, arch
    ===========  =============================================================  ================================

    Parameters
    ----------
    kind : str
    **parameters : float
        Those of the kind; each has a value by default.

    Raises
    ------
    InputError
        If there is no such kind, it has no such parameter, or no leaf is like that.
    """
    made = LEAF_KINDS[require_choice(kind, tuple(LEAF_KINDS), "kind")]
    require_known(parameters, made)
    return made(**parameters)


@checked
def _curled(
    length: Millimeters = 120.0, width: Millimeters = 24.0, angle: Degrees = 110.0, arch: Degrees = 0.0
) -> LeafShape:
    sweep = Sweep(length, arch=(-np.radians(arch), 0.0), curl=np.radians(angle) / (width / 2))
    return LeafShape("curled", sweep, long_outline(length, width))


@checked
def _twisted(length: Millimeters = 140.0, width: Millimeters = 16.0, angle: Degrees = 180.0) -> LeafShape:
    return LeafShape("twisted", Sweep(length, twist=(np.radians(angle), 0.0)), long_outline(length, width))


@checked
def _wavy(length: Millimeters = 150.0, width: Millimeters = 5.0, angle: Degrees = 120.0) -> LeafShape:
    return LeafShape("wavy", Sweep(length, arch=(0.0, np.radians(angle))), long_outline(length, width))


@checked
def _winding(length: Millimeters = 150.0, width: Millimeters = 5.0, angle: Degrees = 120.0) -> LeafShape:
    return LeafShape("winding", Sweep(length, sway=(0.0, np.radians(angle))), long_outline(length, width))


@checked
def _eaten(
    length: Millimeters = 110.0, width: Millimeters = 40.0, hole: Gap = 10.0, notch: Gap = 6.0, arch: Degrees = 60.0
) -> LeafShape:
    half = width / 2
    holes = [[0.45 * length, 0.25 * half, hole / 2]]
    # The margin beside the widest place is at ± half; there a disc takes half of itself away.
    notches = [[0.3 * length, -0.99 * half, notch / 2], [0.38 * length, half, notch / 2]]
    outline = eat(long_outline(length, width), holes, notches)
    return LeafShape("eaten", Sweep(length, arch=(-np.radians(arch), 0.0)), outline)


@checked
def _lobed(
    length: Millimeters = 70.0, width: Millimeters = 65.0, lobes: Lobes = 5, depth: Depth = 0.25, arch: Degrees = 70.0
) -> LeafShape:
    outline = lobed_outline(length, width, round(lobes), depth)
    return LeafShape("lobed", Sweep(length, arch=(-np.radians(arch), 0.0)), outline)


@checked
def _cupped(length: Millimeters = 60.0, width: Millimeters = 45.0, radius: Millimeters = 40.0) -> LeafShape:
    sweep = Sweep(length, arch=(length / radius, 0.0), curl=1 / radius)
    return LeafShape("cupped", sweep, oval_outline(length, width))


@checked
def _petiole(
    length: Millimeters = 80.0,
    width: Millimeters = 40.0,
    stalk: Millimeters = 45.0,
    stub: Millimeters = 16.0,
    arch: Degrees = 60.0,
) -> LeafShape:
    radius = 1.2
    sweep = Sweep(length, arch=(-np.radians(arch), 0.0), curl=0.25 / width)
    outline = long_outline(length, width, base=2 * radius / width)
    way = np.arange(-stalk, AXIS_STEP / 2, AXIS_STEP)
    frame = sweep.frame(way[:1])[0]
    # The stem stands across the petiole and the leaf's side, along the frame's normal.
    stem = sweep.axis(way[:1]) + np.arange(-stub / 2, stub / 2, AXIS_STEP)[:, np.newaxis] * frame[:, 2]
    return LeafShape("petiole", sweep, outline, tubes=(Tube(sweep.axis(way), radius), Tube(stem, 2.5 * radius)))


@checked
def _layers(
    length: Millimeters = 80.0, width: Millimeters = 40.0, height: Gap = 0.5, arch: Degrees = 60.0
) -> LeafShape:
    outline = long_outline(length, width)
    patch = affinity.translate(oval_outline(0.28 * length, 0.3 * width), 0.3 * length, 0.22 * width)
    sweep = Sweep(length, arch=(-np.radians(arch), 0.0))
    return LeafShape("layers", sweep, outline, layer=patch, layer_height=height)


LEAF_KINDS: dict[str, Callable[..., LeafShape]] = {
    "curled": _curled,
    "twisted": _twisted,
    "wavy": _wavy,
    "winding": _winding,
    "eaten": _eaten,
    "lobed": _lobed,
    "cupped": _cupped,
    "petiole": _petiole,
    "layers": _layers,
}
"""Kinds of leaves of known shape and what makes them."""
