"""The kinds of leaves of known shape, each with what may be changed of it."""

from collections.abc import Callable

import numpy as np
from shapely import affinity

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks import require_choice
from o3dleaf.samples.leaves.leaf_shape import LeafShape, Tube
from o3dleaf.samples.leaves.outlines import eat, lobed_outline, long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep

AXIS_STEP = 0.5
"""Distance of the points of a stalk's axis, in millimeters."""


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
        If there is no such kind.
    """
    return LEAF_KINDS[require_choice(kind, tuple(LEAF_KINDS), "kind")](**parameters)


def _curled(length: float = 120.0, width: float = 24.0, angle: float = 110.0, arch: float = 0.0) -> LeafShape:
    sweep = Sweep(length, arch=(-np.radians(arch), 0.0), curl=np.radians(angle) / (width / 2))
    return LeafShape("curled", sweep, long_outline(length, width))


def _twisted(length: float = 140.0, width: float = 16.0, angle: float = 180.0) -> LeafShape:
    return LeafShape("twisted", Sweep(length, twist=(np.radians(angle), 0.0)), long_outline(length, width))


def _wavy(length: float = 150.0, width: float = 5.0, angle: float = 120.0) -> LeafShape:
    return LeafShape("wavy", Sweep(length, arch=(0.0, np.radians(angle))), long_outline(length, width))


def _winding(length: float = 150.0, width: float = 5.0, angle: float = 120.0) -> LeafShape:
    return LeafShape("winding", Sweep(length, sway=(0.0, np.radians(angle))), long_outline(length, width))


def _eaten(
    length: float = 110.0, width: float = 40.0, hole: float = 10.0, notch: float = 6.0, arch: float = 60.0
) -> LeafShape:
    half = width / 2
    holes = [[0.45 * length, 0.25 * half, hole / 2]]
    # The margin beside the widest place is at ± half; there a disc takes half of itself away.
    notches = [[0.3 * length, -0.99 * half, notch / 2], [0.38 * length, half, notch / 2]]
    outline = eat(long_outline(length, width), holes, notches)
    return LeafShape("eaten", Sweep(length, arch=(-np.radians(arch), 0.0)), outline)


def _lobed(
    length: float = 70.0, width: float = 65.0, lobes: float = 5, depth: float = 0.25, arch: float = 70.0
) -> LeafShape:
    outline = lobed_outline(length, width, round(lobes), depth)
    return LeafShape("lobed", Sweep(length, arch=(-np.radians(arch), 0.0)), outline)


def _cupped(length: float = 60.0, width: float = 45.0, radius: float = 40.0) -> LeafShape:
    sweep = Sweep(length, arch=(length / radius, 0.0), curl=1 / radius)
    return LeafShape("cupped", sweep, oval_outline(length, width))


def _petiole(
    length: float = 80.0, width: float = 40.0, stalk: float = 45.0, stub: float = 16.0, arch: float = 60.0
) -> LeafShape:
    radius = 1.2
    sweep = Sweep(length, arch=(-np.radians(arch), 0.0), curl=0.25 / width)
    outline = long_outline(length, width, base=2 * radius / width)
    way = np.arange(-stalk, AXIS_STEP / 2, AXIS_STEP)
    frame = sweep.frame(way[:1])[0]
    # The stem stands across the petiole and the leaf's side, along the frame's normal.
    stem = sweep.axis(way[:1]) + np.arange(-stub / 2, stub / 2, AXIS_STEP)[:, np.newaxis] * frame[:, 2]
    return LeafShape("petiole", sweep, outline, tubes=(Tube(sweep.axis(way), radius), Tube(stem, 2.5 * radius)))


def _layers(length: float = 80.0, width: float = 40.0, height: float = 0.5, arch: float = 60.0) -> LeafShape:
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
