"""What is left of drift and rings that are put into `samples.wheat_ct`, over what was put in, and what has none loses.

python scripts/measure_corrections.py [--spacings 24 12 6] [--noises 0 0.05]

Root mean squares over all voxels. Rings have another height in each slice and at each multiple of a voxel, of deviation
0.03, and are linear between; the step from air to leaf is 0.19. The drift is of gain and of zero, a quarter of the step
together; what is left of it is told but for one gain and one zero of the whole.
"""

import argparse

import numpy as np
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.samples import wheat_ct

HEIGHT, OFFSET, GAIN = 0.03, 0.05, 0.2
AXIS = np.array([0.4, 0.55])
"""Of the rings, in sizes of the volume: not in its middle."""


def ringed(volume, axis):
    """Return a volume with rings around an axis."""
    x, y = (volume.origin[k] + volume.spacing[k] * np.arange(volume.shape[k]) - axis[k] for k in range(2))
    radii = np.hypot(x[:, None], y) / volume.spacing[0]
    knots = np.arange(int(radii.min()), int(radii.max()) + 2)
    heights = HEIGHT * np.random.default_rng(3).standard_normal((volume.shape[2], len(knots)))
    return changed(volume, volume.data + np.stack([np.interp(radii, knots, row) for row in heights], axis=2))


def drifting(volume):
    """Return a volume whose gain and zero drift along z."""
    z = np.linspace(0, 1, volume.shape[2])
    return changed(volume, volume.data * (1 + GAIN * z**2) + OFFSET * np.sin(3 * z))


def changed(volume, data):
    """Return a volume with other intensities."""
    return o3l.Volume(data, volume.spacing, volume.origin, volume.unit)


def off(volume, other):
    """Return the root mean square of a difference."""
    return float(np.sqrt(np.mean((volume.data - other.data) ** 2)))


def off_but_for_scale(volume, other):
    """Return the root mean square of what no gain and zero of the whole accounts for."""
    x, y = (each.data.ravel().astype(np.float64) for each in (volume, other))
    return float(np.std(np.polyval(np.polyfit(x, y, 1), x) - y))


def main():
    """Print a row for each spacing and noise."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--spacings", nargs="+", type=float, default=[24, 12, 6], help="in um")
    options.add_argument("--noises", nargs="+", type=float, default=[0.0, 0.05])
    given = options.parse_args()
    table = Table("um", "noise", "rings left", "drift left", "rings taken of none", "drift taken of none")
    for spacing in given.spacings:
        for noise in given.noises:
            clean = wheat_ct(seed=0, noise=noise, spacing=spacing)[0]
            axis = clean.bounds[0, :2] + AXIS * np.ptp(clean.bounds[:, :2], axis=0)
            rings, drift = ringed(clean, axis), drifting(clean)
            found = (
                off(o3l.remove_rings(rings, axis), clean) / off(rings, clean),
                off_but_for_scale(o3l.remove_drift(drift), clean) / off_but_for_scale(drift, clean),
                off(o3l.remove_rings(clean), clean),
                off(o3l.remove_drift(clean), clean),
            )
            table.add_row(f"{spacing:g}", f"{noise:g}", *(f"{value:.2g}" for value in found))
    Console().print(table)


if __name__ == "__main__":
    main()
