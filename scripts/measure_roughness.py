"""Measure how rough, and how far off, the fitted surface of a bone-like volume is beside that of a Gaussian's.

    python scripts/measure_roughness.py [--size 96] [--seeds 2]

A gyroid with waves in it, as struts of some eight voxels; intensities are those of air and bone, 60 and 180, blurred by
0.7 voxels, with normal noise, independent or correlated as after a Gaussian of 0.7 voxels, rounded to 8 bits. Surfaces
are the level's, by marching cubes at the voxels: of the fit that `create_texture` makes (its smoothing by
cross-validation), of the voxels, of these after a Gaussian of half a voxel and of others, and of the truth itself.
Printed are the root mean square of the distances of the vertices from the truth's surface, in voxels, and the mean turn
between neighboring triangles, in degrees.
"""

import argparse

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

import o3dleaf as o3l
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.surface.isosurface.polygonize import polygonize
from o3dleaf.surface.mesh.topology import EdgeTable

PERIOD, WAVES, WAVE, SHIFT = 34.0, 24, 0.05, 0.35
"""Voxels of the gyroid; number, amplitude and place of what disturbs it."""
LOW, HIGH, BLUR = 60.0, 180.0, 0.7
NOISES = (0.0, 3.0, 8.0, 16.0, 30.0)
GAUSSIANS = (0.5, 0.8, 1.2)
RIM = 3.0
"""Voxels beside the faces of the box that are not looked at."""


class Bone:
    """A function that is zero on the surface of the bone and positive in it, with its gradient."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        direction = rng.standard_normal((WAVES, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self.waves = direction * rng.uniform(1.5, 4.0, (WAVES, 1)) * 2 * np.pi / PERIOD
        self.phases, self.shift = rng.uniform(0, 6.3, WAVES), rng.uniform(0, PERIOD, 3)

    def __call__(self, points):
        u = (points + self.shift) * (2 * np.pi / PERIOD)
        s, c = np.sin(u), np.cos(u)
        value = (s * np.roll(c, -1, axis=1)).sum(axis=1) - SHIFT
        slope = (c * np.roll(c, -1, axis=1) - s * np.roll(s, 1, axis=1)) * (2 * np.pi / PERIOD)
        angle = points @ self.waves.T + self.phases
        return value + WAVE * np.sin(angle).sum(axis=1), slope + WAVE * np.cos(angle) @ self.waves

    def distance(self, points):
        """Signed distances to the surface, to first order."""
        value, slope = self(points)
        return value / np.maximum(np.linalg.norm(slope, axis=1), 1e-9)

    def off(self, points):
        """Distances of points near the surface, to first order three times over."""
        moved = points.copy()
        for _ in range(3):
            value, slope = self(moved)
            moved -= (value / np.maximum(np.sum(slope**2, axis=1), 1e-12))[:, np.newaxis] * slope
        return np.linalg.norm(moved - points, axis=1)


def turn(vertices, triangles):
    """Mean angle between the normals of triangles with an edge in common, in degrees."""
    corner = vertices[triangles]
    normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normals, axis=1)
    edges = EdgeTable.of(triangles)
    owner = np.argsort(edges.of_half, kind="stable")
    first = np.searchsorted(edges.of_half[owner], np.flatnonzero(edges.count == 2))
    pairs = np.stack([owner[first], owner[first + 1]], axis=1) // 3
    pairs = pairs[(size[pairs] > 1e-9).all(axis=1)]
    unit = normals / np.maximum(size, 1e-300)[:, np.newaxis]
    return float(np.degrees(np.arccos(np.clip((unit[pairs[:, 0]] * unit[pairs[:, 1]]).sum(axis=1), -1, 1))).mean())


def judged(samples, level, bone):
    """Error and roughness of the surface of samples."""
    vertices, triangles = polygonize(samples, level)
    inner = ((vertices > RIM) & (vertices < np.array(samples.shape) - 1 - RIM)).all(axis=1)
    return float(np.sqrt((bone.off(vertices[inner]) ** 2).mean())), turn(
        vertices, triangles[inner[triangles].all(axis=1)]
    )


def measure(size, noise, seed, correlated):
    """Error and roughness of each surface."""
    bone, rng = Bone(seed), np.random.default_rng(100 + seed)
    lattice = Lattice((0.0,) * 3, (1.0,) * 3, (size,) * 3)
    distance = sample_lattice(bone.distance, lattice)
    clean = LOW + (HIGH - LOW) * ndtr(np.clip(distance, -9, 9) / BLUR)
    drawn = rng.standard_normal(clean.shape)
    if correlated:
        drawn = gaussian_filter(drawn, BLUR, mode="wrap")
        drawn /= drawn.std()
    data = np.clip(np.rint(clean + noise * drawn), 0, 255).astype(np.uint8)
    level = (LOW + HIGH) / 2
    rows = {"truth": judged(distance, 0.0, bone)}
    fit = o3l.PUInterpolant.fit_lattice(data, spacing=1.0, isovalue=level, band=True, rho="gcv")
    rows["fit"] = judged(sample_lattice(fit, lattice), 0.0, bone)
    rows["voxels"] = judged(data.astype(float), level, bone)
    for width in GAUSSIANS:
        rows[f"Gaussian {width}"] = judged(gaussian_filter(data.astype(float), width), level, bone)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    for noise, correlated in [*((each, False) for each in NOISES), *((each, True) for each in NOISES[1:-1])]:
        found = [measure(given.size, noise, seed, correlated) for seed in range(given.seeds)]
        print(f"noise {noise:g} of a step of {HIGH - LOW:g}{', correlated' if correlated else ''}")
        for name in found[0]:
            error, angle = np.mean([each[name] for each in found], axis=0)
            print(f"  {name:<14} {error:8.4f} voxels off, {angle:6.2f} degrees", flush=True)


if __name__ == "__main__":
    main()
