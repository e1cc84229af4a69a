"""A synthetic micro-CT volume of a wheat blade, a stand-in for the scan that the paper used."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, NotNegative, Positive, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.samples.micro import WheatPatch

Intensities = npt.NDArray[np.float32]

PITCH = 280.0
"""Distance between ridges, in micrometers."""
FLOOR = -200.0
"""Lower side of the patch; the blade's middle is at 0, in micrometers."""
MARGIN = 60.0
"""No hair and no pocket comes nearer to the edge of the patch, in micrometers."""
LARGEST_EXTENT = 10_000.0
"""Of a patch, in micrometers: hairs are set one after another, each away from all before it."""
BLUR = 0.6
"""Standard deviation of the scanner's point spread, in voxels."""
SLAB = 1 << 20
"""Voxels that are evaluated at once: 8 MB for each of a few arrays, in each thread."""
GRAIN = 0.4
"""Standard deviation of the reconstruction filter that correlates the noise, in voxels."""


@checked
def wheat_ct(
    *,
    seed: Whole = 0,
    spacing: Positive = 24.0,
    size: tuple[Positive, Positive, Positive] = (1680.0, 1680.0, 480.0),
    noise: NotNegative = 0.01,
    drift: Finite = 0.1,
    ridges: Positive | None = None,
) -> tuple[Volume, WheatPatch]:
    """Return a synthetic micro-CT volume of a wheat blade, and the noise-free truth as a Field.

    Ridges run along x; tapered hairs stand on them and lean towards the tip of the leaf, a few hang
    from the abaxial face; stomata are pits between the ridges; the mesophyll holds closed air
    pockets. No hair or pocket is cut by the edge. The same seed gives the same leaf at any spacing;
    the default has 70 × 70 × 20 = 98,000 voxels, about the number in the paper.

    Parameters
    ----------
    seed : int
        Of the leaf and of the noise.
    spacing : float
        Voxel size in micrometers, for example 24 or 3; the blur is 0.6 of it.
    size : (3,) floats
        Extent of the patch, face to face, in micrometers.
    noise : float
        Standard deviation of the noise, in intensity; leaf is 0.2 and air 0.
    drift : float
        How much darker, relatively, the middle of the patch is than its corners (beam hardening).
    ridges : float, optional
        Number of ridges across y (default: the whole number that makes them about 280 µm wide); a
        fraction makes tiles that do not fit.

    Returns
    -------
    volume : Volume
        32-bit intensities, in micrometers.
    truth : WheatPatch
        The intensity without noise and drift; leaf is where ``truth(points) > truth.level``.

    Raises
    ------
    InputError
        If the spacing is not above zero or the patch is too small for a hair.
    """
    step, extent = require_positive(spacing, "spacing"), np.asarray(size, dtype=np.float64)
    if extent.shape != (3,) or (extent < [600.0, 600.0, 480.0]).any() or extent.max() > LARGEST_EXTENT:
        raise InputError(
            f"size: is {size}; give at least 600, 600 and 480 micrometers, room for a hair and for air, and at most "
            f"{LARGEST_EXTENT:,.0f}"
        )
    with np.errstate(over="ignore"):
        count = float(np.prod(extent / step))
    cure = "give a larger one"
    require_resources(measured.MADE_VOXEL * count, f"spacing: {in_words(count)} voxels", cure, step=step, power=3)
    shape = np.round(extent / step).astype(int)
    low = np.array([0.0, 0.0, FLOOR])
    leaf_seed, noise_seed = np.random.SeedSequence(seed).spawn(2)
    number = float(ridges) if ridges is not None else max(1.0, round(extent[1] / PITCH))
    truth = _grow(np.random.default_rng(leaf_seed), np.stack([low, low + shape * step]), BLUR * step, number)
    data = _sample(truth, shape, low + 0.5 * step, step)
    _add_drift(data, drift)
    if noise > 0:
        data += _noise(np.random.default_rng(noise_seed), data.shape, noise)
    return Volume(data, step, low + 0.5 * step, "um"), truth


def _grow(rng: np.random.Generator, bounds: FloatArray, blur: float, ridges: float) -> WheatPatch:
    """Scatter hairs, stomata and pockets over the ridges of a bare blade."""
    phases = rng.uniform(0, 2 * np.pi, 3)
    none = np.empty((0, 8)), np.empty((0, 2)), np.empty((0, 6))
    bare = WheatPatch(bounds, blur, ridges, phases, *none)
    pitch = (bounds[1, 1] - bounds[0, 1]) / ridges
    crests = bounds[0, 1] + pitch * np.arange(np.floor(ridges) + 1)
    valleys = crests + 0.5 * pitch
    stomata = np.concatenate([_row(rng, bounds, valley, 170.0, 8.0) for valley in valleys])
    pockets = np.concatenate([_row(rng, bounds, crest, 190.0, 25.0) for crest in crests])
    pockets = _within(pockets[rng.random(len(pockets)) < 0.75], bounds, MARGIN + 60.0)
    count = len(pockets)
    half = np.array([58.0, 46.0, 36.0]) * rng.uniform(0.85, 1.1, (count, 1))
    pockets = np.column_stack([pockets, rng.uniform(-8.0, 10.0, count), half])
    area = np.prod(bounds[1, :2] - bounds[0, :2])
    hairs = _hairs(rng, bare, crests, max(1, round(area / 170e3)), up=True)
    under = _hairs(rng, bare, valleys, max(1, round(area / 800e3)), up=False)
    stomata = _within(stomata, bounds, MARGIN + 30.0)
    return WheatPatch(bounds, blur, ridges, phases, np.concatenate([hairs, under]), stomata, pockets)


def _row(rng: np.random.Generator, bounds: FloatArray, y: float, step: float, jitter: float) -> FloatArray:
    """Points (n, 2) about every `step` along x, on a line of constant y, none left out at the edges."""
    x = np.arange(bounds[0, 0] + rng.uniform(0, step), bounds[1, 0], step)
    return np.column_stack([x + rng.uniform(-0.15, 0.15, len(x)) * step, y + rng.uniform(-jitter, jitter, len(x))])


def _within(points: FloatArray, bounds: FloatArray, margin: float) -> FloatArray:
    inside = (points > bounds[0, :2] + margin) & (points < bounds[1, :2] - margin)
    return points[inside.all(axis=1)]


def _hairs(rng: np.random.Generator, bare: WheatPatch, lines: FloatArray, count: int, *, up: bool) -> FloatArray:
    """(n, 8) tapered hairs on the ridge lines of one face, far from the edge and from one another."""
    low, high = bare.bounds[:, :2]
    hairs: list[FloatArray] = []
    for _ in range(60 * count):
        foot = np.array([rng.uniform(low[0], high[0]), rng.choice(lines) + rng.uniform(-30.0, 30.0)])
        length = rng.uniform(110.0, 150.0) if up else rng.uniform(80.0, 95.0)
        rise, turn = np.radians(rng.uniform(32.0, 45.0)), np.radians(rng.uniform(-15.0, 15.0))
        radius, tip_radius = rng.uniform(27.0, 31.0), rng.uniform(13.0, 16.0)
        lean = np.cos(rise) * np.array([np.cos(turn), np.sin(turn)])
        tip = foot + length * lean
        clear = len(_within(np.stack([foot, tip]), bare.bounds, MARGIN + radius)) == 2
        crowded = any(min(np.linalg.norm(foot - h[:2]), np.linalg.norm(tip - h[:2])) < 120.0 for h in hairs)
        if not clear or crowded:
            continue
        top, bottom = bare.faces(foot[np.newaxis])
        # The foot is sunk, so that the hair grows out of the blade instead of standing on it.
        z = top[0] - 0.4 * radius if up else bottom[0] + 0.4 * radius
        climb = length * np.sin(rise) * (1.0 if up else -1.0)
        hairs.append(np.array([*foot, z, *tip, z + climb, radius, tip_radius]))
        if len(hairs) == count:
            break
    return np.array(hairs).reshape(-1, 8)


def _sample(truth: WheatPatch, shape: npt.NDArray[np.int_], origin: FloatArray, step: float) -> Intensities:
    """Evaluate the truth at the voxel centers, slab by slab along x, as 32-bit floats."""
    x, y, z = (origin[a] + step * np.arange(shape[a]) for a in range(3))
    data = np.empty((len(x), len(y), len(z)), dtype=np.float32)

    def task(start: int, stop: int) -> None:
        data[start:stop] = truth.on_lattice(x[start:stop], y, z)

    run_blocks(task, len(x), max(1, SLAB // (len(y) * len(z))))
    return data


def _add_drift(data: Intensities, drift: float) -> None:
    """Darken the middle of the patch, as beam hardening does; slow and multiplicative, in place."""
    x, y = (np.linspace(-1.0, 1.0, n, dtype=np.float32) for n in data.shape[:2])
    cup = 1.0 - 0.5 * (x[:, np.newaxis] ** 2 + y**2)
    data *= (1.0 - drift * cup).astype(np.float32)[:, :, np.newaxis]


def _noise(rng: np.random.Generator, shape: tuple[int, ...], sigma: float) -> Intensities:
    """Draw normal noise of standard deviation `sigma`, a little correlated between neighbors."""
    white = rng.standard_normal(shape, dtype=np.float32)
    grain: Intensities = gaussian_filter(white, GRAIN)
    grain *= np.float32(sigma / grain.std())
    return grain
