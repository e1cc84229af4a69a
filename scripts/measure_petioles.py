"""Petioles of known size, seen whole or from one side, and narrow leaves without one: which are found and cut off.

    python scripts/measure_petioles.py [--narrow] [--strays SHARE] [--thinned SHARE] [--held-out] [NUMBER ...]

Printed are how many petioles are cut off, with the shares of their points and of the blade's that are, and the sizes
of those that are kept, in spacings and in widths, and whether they are told; with `--narrow` the narrow leaves that
something is cut off of, or told. With `--strays`, that share of points more lies anywhere in the box around each leaf,
made as deep as it is wide. With `--thinned`, the petiole is seen worse the farther from the blade: of its points at its
end that share is left.
"""

import argparse

import numpy as np

from o3dleaf.leaf.chart.petiole import find_petiole
from o3dleaf.samples.leaves.kinds import leaf_shape
from o3dleaf.samples.leaves.leaf_scan import draw_places, scan_leaf
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.outlines import long_outline, oval_outline
from o3dleaf.samples.leaves.sweep import Sweep
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

ARCS = (120.0, 150.0, 180.0, 360.0)
NOISES = (0.0, 0.1, 0.3, 0.5)
NARROW = {"twisted": (160, 240), "winding": (60, 140), "wavy": (60, 140), "curled": (60, 120)}


def draw_petiole(number, *, thinned=1.0, held_out=False):
    """Return points of a leaf whose blade is arched, which of them are its petiole's, and the sizes that were drawn.

    Of the petiole's points the share that is left falls to `thinned` at its end.
    """
    rng = np.random.default_rng((21000 if held_out else 500) + number)
    width, ratio, diameter = rng.uniform(15, 60), rng.uniform(1.2, 3.0), rng.uniform(1.0, 4.0)
    length, spacing = rng.uniform(0.3, 1.5) * width, rng.uniform(0.3, 1.0)
    arc, noise = ARCS[number % 4], NOISES[number // 4 % 4] * spacing
    outline = (oval_outline if rng.random() < 0.5 else long_outline)(width * ratio, width)
    arch = np.radians(rng.uniform(0, 70))
    leaf = LeafShape("curled", Sweep(width * ratio, arch=(-arch, 0.0)), outline)
    base, frame = leaf.lift([[0.0, 0.0]])[0], leaf.jacobian([[0.0, 0.0]])[0, :, 0]
    ahead = frame / np.linalg.norm(frame)
    up = np.cross(ahead, [0.0, 1.0, 0.0])
    up *= np.sign(up[2])
    count = round(np.radians(arc) / 2 * diameter * length / spacing**2)
    turn, down = rng.uniform([[-arc / 2], [-length]], [[arc / 2], [1.0]], (2, count))
    across = diameter / 2 * np.sin(np.radians(turn))
    above = diameter / 2 * (np.cos(np.radians(turn)) - 1)
    stalk = base + down[:, np.newaxis] * ahead + across[:, np.newaxis] * [0.0, 1.0, 0.0] + above[:, np.newaxis] * up
    blade = leaf.lift(draw_places(leaf, spacing, "random", rng))
    points = np.concatenate([blade, stalk])
    points += rng.normal(0, noise, points.shape)
    left = np.random.default_rng(number).random(count) < 1 - (1 - thinned) * np.maximum(-down, 0) / length
    points = np.concatenate([points[: len(blade)], points[len(blade) :][left]])
    drawn = {"arc": arc, "diameter": diameter, "length": length, "width": width, "spacing": spacing, "noise": noise}
    return points, np.arange(len(points)) >= len(blade), drawn


def draw_narrow(number, *, held_out=False):
    """Return points of a narrow leaf, and what it is."""
    rng = np.random.default_rng((23000 if held_out else 600) + number)
    kind = list(NARROW)[number % 4]
    size = {"angle": rng.uniform(*NARROW[kind]), "length": rng.uniform(110, 190), "width": rng.uniform(5, 14)}
    noise, spacing = NOISES[number // 4 % 4], rng.uniform(0.4, 0.9)
    return scan_leaf(leaf_shape(kind, **size), seed=number, spacing=spacing, noise=noise).points, f"{kind} {size}"


def add_strays(points, share, number):
    """Return points with that share of strays after them."""
    low, high = points.min(axis=0), points.max(axis=0)
    lacking = max(0.0, np.sort(high - low)[1] - (high - low)[2])
    low[2], high[2] = low[2] - lacking / 2, high[2] + lacking / 2
    strays = np.random.default_rng(number).uniform(low, high, (round(share * len(points)), 3))
    return np.concatenate([points, strays])


def found_in(points):
    """Return which points are kept, the petiole or None, and what may be one, as of a blade."""
    return find_petiole(points, OrientedCloud.of(points).noise)


def tell_kept(number, drawn, *, told):
    """Print the sizes of a petiole that is kept, and whether it is told."""
    spacing = drawn["spacing"]
    print(
        f"{number:2d} arc {drawn['arc']:.0f}°: {drawn['diameter'] / spacing:.1f} spacings wide, noise "
        f"{drawn['noise'] / spacing:.1f}; {drawn['length'] / drawn['diameter']:.1f} times as long as wide, "
        f"{drawn['length'] / drawn['width']:.2f} of the blade's width, that {drawn['width'] / drawn['diameter']:.1f}"
        f"{'; told' if told else ''}",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", metavar="NUMBER", type=int, nargs="*")
    parser.add_argument("--narrow", action="store_true", help="narrow leaves without a petiole")
    parser.add_argument("--strays", metavar="SHARE", type=float, default=0.0, help="of the points, that lie anywhere")
    parser.add_argument("--thinned", metavar="SHARE", type=float, default=1.0, help="of a petiole's points at its end")
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    options = parser.parse_args()
    if options.narrow:
        count = lines = 0
        for number in options.numbers or range(96):
            points, name = draw_narrow(number, held_out=options.held_out)
            _, petiole, part = found_in(add_strays(points, options.strays, number))
            count += petiole is not None
            lines += part is not None
            if petiole is not None:
                print(f"{number:2d} {name}: {petiole}", flush=True)
        print(
            f"{count} of {len(options.numbers) or 96} narrow leaves lose something; {lines} told to have a narrow part"
        )
    else:
        shares, lines = [], 0
        for number in options.numbers or range(60):
            points, is_stalk, drawn = draw_petiole(number, thinned=options.thinned, held_out=options.held_out)
            kept, petiole, part = found_in(add_strays(points, options.strays, number))
            kept = kept[: len(points)]
            if petiole is None:
                tell_kept(number, drawn, told=part is not None)
                lines += part is not None
            else:
                shares.append([np.mean(~kept[is_stalk]), np.mean(~kept[~is_stalk])])
        cut = np.quantile(shares, [0.05, 0.5, 0.95], axis=0).T
        print(f"{len(shares)} of {len(options.numbers) or 60} are cut off, {lines} told")
        print(f"5, 50, 95 % of the shares that are cut off of petiole and blade: {np.round(cut, 3)}")
