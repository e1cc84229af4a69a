"""Measure how well a threshold is chosen: surface errors over that of the best level.

    python scripts/measure_levels.py [--quick] [--only FAMILY ...]

Synthetic volumes with a known surface are fitted as `create_texture` does (smoothing by cross-validation), and the
surface is extracted at the level that each method chooses and at a fine scan of levels. The error is the root mean
square of the distances from the truth to the surface and back; loose pieces and voids, which the pipeline removes,
are left out of both. Noise is in the intensities of `samples.wheat_ct`, whose step from air to leaf is 0.2; other
families have it in the same proportion to their own step.
"""

import argparse
import time

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

import o3dleaf as o3l
from o3dleaf.core.errors import InputError
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.leaf.ct.threshold import METHODS
from o3dleaf.surface.isosurface.polygonize import polygonize
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import label_triangles

NOISES = (0.0, 0.003, 0.01, 0.02, 0.04, 0.06)
SEEDS = (0, 1, 2)
STEP = 0.2
"""From air to leaf in `samples.wheat_ct`."""
FINER = 2
"""Samples of the surface along the edge of a voxel."""
PIECE = 0.1
"""A piece with a smaller share of the triangles is a void or a speck."""
SCAN = np.linspace(-0.15, 0.15, 31)
"""Levels beside the middle, in steps from air to leaf."""
RIM = 2.0
"""Voxels beside the faces of the box that are not looked at."""


def wheat(seed, noise):
    """The patch of the paper's size, with beam hardening."""
    volume, truth = o3l.samples.wheat_ct(seed=seed, noise=noise)
    return volume, truth, truth.level, STEP


def fine_wheat(seed, noise):
    """A smaller patch of smaller voxels without beam hardening."""
    volume, truth = o3l.samples.wheat_ct(
        seed=seed, noise=noise, spacing=14.0, size=(700, 700, 504), drift=0.0, ridges=3
    )
    return volume, truth, truth.level, STEP


def coarse_wheat(seed, noise):
    """Voxels nearly as large as the hairs, strong beam hardening, whole numbers with an offset."""
    volume, truth = o3l.samples.wheat_ct(seed=seed, noise=noise, spacing=36.0, size=(2520, 2520, 504), drift=0.2)
    counts = np.rint(20_000 + 40_000 * volume.data).clip(0, 65_535).astype(np.uint16)
    return o3l.Volume(counts, volume.spacing, volume.origin, "um"), Scaled(truth, 40_000, 20_000), 24_000, 8000


def tori(seed, noise):
    """A torus in a fluid: grey levels 300 and 1100, a blur of a voxel, a tenth of the box full."""
    return known_solid(o3l.samples.Torus(1.0, 0.4 + 0.03 * seed), 1.0, (300.0, 1100.0), seed, noise, blur=1.0)


def cavities(seed, noise):
    """A round cavity in a block: the denser part is the larger one by far, a blur of 0.8 voxels."""
    return known_solid(o3l.samples.Sphere(0.8 + 0.05 * seed), -1.0, (-1000.0, 400.0), seed, noise, blur=0.8)


FAMILIES = (wheat, fine_wheat, coarse_wheat, tori, cavities)


class Scaled:
    """A field times a factor and plus a shift."""

    def __init__(self, field, factor, shift):
        self.field, self.factor, self.shift, self.bounds = field, factor, shift, field.bounds

    def __call__(self, points):
        """Return the values."""
        return self.shift + self.factor * self.field(points)

    def gradient(self, points):
        """Return the gradients."""
        return self.factor * self.field.gradient(points)


def known_solid(solid, sign, grey, seed, noise, *, blur, cells=46):
    """A blurred solid (sign 1) or the hole that it leaves (−1), with noise as a scanner's."""
    low, high = solid.bounds
    step = float((high - low).max()) / cells
    shape = np.ceil((high - low) / step).astype(int)
    centers = low + 0.5 * step + step * np.argwhere(np.ones(shape, dtype=bool))
    width = grey[1] - grey[0]
    data = grey[0] + width * ndtr(sign * solid(centers) / (blur * step)).reshape(shape)
    if noise:
        grain = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), 0.4)
        data += noise / STEP * width * grain / grain.std()
    return o3l.Volume(data, step, low + 0.5 * step), Scaled(solid, sign, 0.0), 0.0, width, np.mean(grey)


def surface(samples, lattice, level, box):
    """Return the vertices and triangles of the large pieces in a box."""
    vertices, triangles = polygonize(samples, level)
    if len(triangles) == 0:
        return None
    pieces = label_triangles(triangles)
    large = np.bincount(pieces) >= PIECE * len(triangles)
    vertices = lattice.positions(vertices)
    inside = ((vertices > box[0]) & (vertices < box[1])).all(axis=1)
    triangles = triangles[large[pieces]]
    return vertices, triangles, np.intersect1d(np.unique(triangles), np.flatnonzero(inside))


def on_truth(points, truth, level):
    """Return the points moved onto the truth's surface."""
    for _ in range(3):
        slope = truth.gradient(points)
        points = points + ((level - truth(points)) / (slope**2).sum(axis=1))[:, np.newaxis] * slope
    return points


def error(found, truth):
    """Return the root mean square of the distances both ways, of (vertices, triangles, those that count)."""
    if found is None:
        return np.inf
    there = distance_to_mesh(*truth[:2], found[0][found[2]])
    back = distance_to_mesh(*found[:2], truth[0][truth[2]])
    return float(np.sqrt((np.mean(there**2) + np.mean(back**2)) / 2))


def rows(family, seed, noise):
    """Return the best level with its error, and of each method level, error over the best and processor time."""
    volume, truth, level, width, *middle = family(seed, noise)
    middle = middle[0] if middle else level
    field = o3l.PUInterpolant.fit_lattice(
        volume.data, spacing=volume.spacing, origin=volume.origin, rho="gcv", unit=volume.unit, bounds=volume.bounds
    )
    lattice = Lattice.covering(volume.voxel_bounds, volume.spacing / FINER)
    samples = sample_lattice(field, lattice)
    box = volume.bounds + RIM * np.array([[1.0], [-1.0]]) * volume.spacing
    vertices, triangles, used = surface(sample_lattice(truth, lattice), lattice, level, box)
    vertices[np.unique(triangles)] = on_truth(vertices[np.unique(triangles)], truth, level)
    known = vertices, triangles, used

    def of(each):
        return error(surface(samples, lattice, each, box), known)

    levels = middle + width * SCAN
    coarse = np.array([of(each) for each in levels[::3]])
    around = np.flatnonzero(abs(levels - levels[::3][coarse.argmin()]) < 0.021 * width)
    fine = np.array([of(levels[k]) for k in around])
    found = {}
    for method in METHODS:
        start = time.process_time()
        try:
            chosen = volume.threshold(method)
        except InputError:
            found[method] = (np.nan, np.nan, time.process_time() - start)
            continue
        seconds = time.process_time() - start
        found[method] = (chosen, of(chosen), seconds)
    best = min(fine.min(), *(each[1] for each in found.values() if each[1] == each[1]), np.inf)
    return levels[around[fine.argmin()]], best, float(volume.spacing[0]), found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one seed, three noises")
    parser.add_argument(
        "--only", nargs="+", metavar="FAMILY", help="of " + ", ".join(each.__name__ for each in FAMILIES)
    )
    given = parser.parse_args()
    worst = {}
    for family in FAMILIES:
        if given.only and family.__name__ not in given.only:
            continue
        print(f"{family.__name__}: {family.__doc__}")
        for noise in NOISES[::2] if given.quick else NOISES:
            for seed in SEEDS[:1] if given.quick else SEEDS:
                level, best, step, found = rows(family, seed, noise)
                line = f"  noise {noise:<5g} seed {seed}: best {level:9.5g}, error {best / step:.4f} voxels;"
                for method, (chosen, off, seconds) in found.items():
                    line += f"  {method} {chosen:9.5g} ×{off / best:.3f} ({seconds:.2f} s)"
                    worst.setdefault((family.__name__, method), []).append(off / best)
                print(line, flush=True)
    for (family, method), ratios in worst.items():
        refused = int(np.isnan(ratios).sum())
        print(f"{family:>14} {method:>8}: worst ×{np.nanmax([*ratios, 1]):.3f}, refused {refused} of {len(ratios)}")


if __name__ == "__main__":
    main()
