"""Landing places of droplets: on a ridge, in a furrow, on a hair, chosen by a seed from the heights of the face."""

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, gaussian_filter

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.droplet.surfaces import LandingWindow

KINDS = ("ridge", "furrow", "hair")
"""Kinds of places, in turn."""
HIGH, LOW = 0.9, 0.1
"""Quantiles of the face's heights from which on a place is a ridge, or a furrow."""
STANDS_OUT = 0.03
"""Millimeters by which a hair is higher than the face without."""


def choose_places(
    leaf: MultiscaleLeaf, middle: tuple[float, float], count: int, seed: int, size: float, unit: float
) -> list[tuple[str, tuple[float, float]]]:
    """Return kinds and places (along, across), within one period of the texture around the middle.

    Parameters
    ----------
    size : float
        Width of the window around each, which must be on the blade.
    unit : float
        A millimeter in the leaf's unit.

    Raises
    ------
    InputError
        If the window of none of a kind is on the blade.
    """
    extent = float(min(np.asarray(leaf.texture.period)[:2] / leaf.scale))
    window = LandingWindow(leaf, middle, extent, 0.02 * unit)
    face, hairs = face_heights(window)
    low, high = np.quantile(face, (LOW, HIGH))
    hair = hairs > STANDS_OUT * unit
    # A ridge and a furrow are places without a hair near: one would be met first.
    apart = distance_transform_edt(~hair) * window.step if hair.any() else np.full(face.shape, np.inf)
    free = apart > 0.1 * unit
    masks = {"ridge": (face >= high) & free, "furrow": (face <= low) & free, "hair": hair}
    generator = np.random.default_rng(seed)
    shuffled = {kind: generator.permutation(np.flatnonzero(mask)) for kind, mask in masks.items()}
    curve, found = leaf.edge_curve(closed=True), list[tuple[str, tuple[float, float]]]()
    plane = np.stack(np.meshgrid(*window.grid, indexing="ij"), axis=-1).reshape(-1, 2)
    reach = 0.6 * size
    used = dict.fromkeys(KINDS, 0)
    for number in range(count):
        kind = KINDS[number % len(KINDS)]
        while used[kind] < len(shuffled[kind]):
            place = plane[shuffled[kind][used[kind]]]
            used[kind] += 1
            if shapely.box(*(place - reach), *(place + reach)).within(curve):
                found.append((kind, (float(place[0]), float(place[1]))))
                break
        else:
            raise InputError(f"points: no {kind} is left around there; give another place, or fewer points")
    return found


def face_heights(window: LandingWindow) -> tuple[FloatArray, FloatArray]:
    """Return the heights of the face without hairs over the grid, less its slow waves, and how far hairs stand out."""
    bare = window.bare_heights
    return bare - gaussian_filter(bare, len(bare) / 4, mode="nearest"), window.top_heights - bare
