"""Blades of leaves seen by a line scanner's parallel planes in space, which lie along some leaves: errors of areas.

python scripts/measure_planes.py [--first N] [--leaves N]

Leaves are drawn by number: lanceolate, oval, lobed, and oval with a hole, in turns, bent and twisted by chance. Planes
have any direction for even numbers, and for odd ones about that of a place on the leaf. Each leaf is made twice,
without planes looked for and with. Points are `ratio` times as close along lines as these are apart, on the mean over
the leaf. Areas are relative to the leaf's; holes are those found of those that there are.
"""

import argparse
from unittest.mock import patch

import numpy as np
from rich.console import Console

import o3dleaf as o3l
from o3dleaf.leaf.margin.scan_planes import find_scan_planes
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.outlines import eat, lobed_outline, long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep

SIDES = ((0, 1), (1, 2), (2, 0))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="number of the first leaf")
    parser.add_argument("--leaves", type=int, default=12)
    args = parser.parse_args()
    console, errors, holes = Console(), [], []
    for number in range(args.first, args.first + args.leaves):
        leaf, points, what = drawn_scan(number)
        found = [measure(leaf, points, planes=planes) for planes in (False, True)]
        told = [f"area {error:+.2%}, {count} of {leaf.holes} holes" for error, count in found]
        console.print(f"{number} {what}, {len(points):,} points: without {told[0]}; with {told[1]}")
        errors.append([error for error, _ in found])
        holes.append([max(count - leaf.holes, 0) for _, count in found])
    for name, each, false in zip(("without", "with"), np.abs(errors).T, np.transpose(holes), strict=True):
        sizes = f"rms {np.sqrt(np.mean(each**2)):.2%}, median {np.median(each):.2%}, largest {each.max():.2%}"
        many = f"{np.count_nonzero(each > 0.01)} beyond 1 %"
        console.print(f"{name}: {sizes}, {many}, {false.sum()} false holes on {np.count_nonzero(false)}")


def measure(leaf, points, *, planes):
    """Return the error of a blade's area, as a share, and its number of holes."""
    search = find_scan_planes if planes else lambda *_: None
    with patch("o3dleaf.leaf.margin.gaps.passed_by.find_scan_planes", search):
        blade = o3l.create_blade(points, unit="mm")
    return o3l.FitQuality.of(blade, points).area[0] / leaf.area - 1, len(blade.outline.hole_rings)


def drawn_scan(number):
    """Return a leaf, the points (n, 3) of its scan, and how it was scanned."""
    leaf, rng = drawn_leaf(number)
    normal = unit(rng.normal(size=3))
    if number % 2:
        length, high = leaf.outline.bounds[2:]
        place = np.array([[rng.uniform(0.25, 0.75) * length, rng.uniform(-0.2, 0.2) * high]])
        normal = unit(leaf.normals(place)[0] + 0.5 * rng.normal(size=3))
    along = unit(np.cross(normal, rng.normal(size=3)))
    vertices, triangles = leaf.mesh(0.5)
    corners = vertices[triangles]
    ways = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(ways, axis=1)
    sines = np.linalg.norm(np.cross(ways / sizes[:, np.newaxis], normal), axis=1)
    spacing, ratio, noise = rng.uniform(0.5, 0.8), rng.choice([2, 4, 6, 8.0]), rng.choice([0, 0.1, 0.2])
    distance = spacing * np.sqrt(ratio) * np.average(sines, weights=sizes)
    points = line_points(corners, normal / distance, along, spacing / np.sqrt(ratio))
    points = points + rng.normal(0, noise * spacing, points.shape)
    return leaf, points, f"spacing {spacing:.2f}, ratio {ratio:g}, noise {noise:g}, planes {distance:.2f} apart"


def line_points(corners, gradient, along, step):
    """Return points (n, 3), so far apart along them, of the lines in which planes cut triangles (m, 3, 3)."""
    heights = corners @ gradient
    first, last = np.ceil(heights.min(axis=1)), np.floor(heights.max(axis=1))
    count = np.maximum(last - first + 1, 0).astype(int)
    row = np.repeat(np.arange(len(corners)), count)
    plane = first[row] + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    above = heights[row] - plane[:, np.newaxis]
    cut = np.stack([(above[:, a] < 0) != (above[:, b] < 0) for a, b in SIDES], axis=1)
    whole = cut.sum(axis=1) == 2
    row, plane, above, cut = row[whole], plane[whole], above[whole], cut[whole]
    ways = np.array(SIDES)[np.nonzero(cut)[1].reshape(-1, 2)]
    a, b = (np.take_along_axis(above, ways[..., end], axis=1) for end in range(2))
    begin, end = (corners[row[:, np.newaxis], ways[..., end]] for end in range(2))
    ends = begin + (a / (a - b))[..., np.newaxis] * (end - begin)
    ends = ends[np.lexsort((ends.mean(axis=1) @ along, plane))]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    before = np.concatenate([[0], np.cumsum(length)])
    at = np.arange(step / 2, before[-1], step)
    row = np.searchsorted(before, at, side="right") - 1
    share = ((at - before[row]) / length[row])[:, np.newaxis]
    return ends[row, 0] + share * (ends[row, 1] - ends[row, 0])


def drawn_leaf(number):
    """Return a leaf by its number, and what else is drawn for it."""
    rng = np.random.default_rng([number, 41])
    kind = number % 4
    if kind == 0:
        outline = long_outline(rng.uniform(80, 140), rng.uniform(14, 30))
    elif kind == 1:
        outline = oval_outline(rng.uniform(50, 90), rng.uniform(35, 60))
    elif kind == 2:
        size = rng.uniform(60, 90), rng.uniform(50, 80)
        outline = lobed_outline(*size, int(rng.integers(3, 8)), rng.uniform(0.08, 0.25))
    else:
        length = rng.uniform(60, 90)
        whole = oval_outline(length, rng.uniform(40, 60))
        outline = eat(whole, [[length * rng.uniform(0.4, 0.6), rng.uniform(-5, 5), rng.uniform(2, 5)]], [])
    _, low, length, high = outline.bounds
    arch = np.radians(rng.uniform(-90, 90)), np.radians(rng.uniform(0, 60))
    sway, twist = (np.radians(rng.uniform(-each, each)) for each in (15, 60))
    curl = 2 * np.radians(rng.uniform(-60, 60)) / (high - low)
    sweep = Sweep(length, arch=arch, sway=(sway, 0.0), twist=(twist, 0.0), curl=curl)
    return LeafShape("drawn", sweep, outline), rng


def unit(vector):
    """Return a vector of length 1."""
    return vector / np.linalg.norm(vector)


if __name__ == "__main__":
    main()
