"""Leaves of known shape scanned with a table, and pressed ones without: what is found, refused and told.

    python scripts/measure_table.py [--pressed] [--held-out] [--blades] [NUMBER ...]

Printed of each scan are the points of table, leaf and clip; whether a blade of the whole scan is refused, told to hold
a table, or neither; and the same points of each piece that can be asked for; with `--blades` also of which of them the
vertices of a blade of the whole scan lie nearest to, as shares. Of pressed leaves those that are taken for a table.
"""

import argparse

import numpy as np
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.parametric.build import refuse_table
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.on_table import drawn_pressed, drawn_table


def counts(what):
    """Return how many are of table, leaf and clip, in words."""
    return " + ".join(str(count) for count in np.bincount(what, minlength=3))


def outcome(points):
    """Return what becomes of a scan."""
    try:
        return "nothing" if refuse_table(points, o3l.BladeOptions()) is None else "told"
    except O3DLeafError:
        return "refused"


def run(number, options):
    """Print the lines of one scan, and return what becomes of it."""
    drawn = drawn_table(number, held_out=options.held_out)
    scan = drawn.scan()
    how = f"{drawn.kind} {drawn.pose}, gap {drawn.gap:g}, noise {drawn.noise:g}, size {drawn.size:.1f}"
    found = outcome(scan.points)
    pieces = find_pieces(scan)
    print(f"{number:2d} {how}: {counts(scan.what)}; {found}; pieces {', '.join(pieces)}", flush=True)
    if options.blades:
        try:
            vertices = np.asarray(o3l.create_blade(scan.points, unit="mm").extract_mesh(1.5).vertices)
            nearest = scan.what[cKDTree(scan.points).query(vertices)[1]]
            print(f"   blade: {np.round(np.bincount(nearest, minlength=3) / len(nearest), 2)}", flush=True)
        except O3DLeafError as refusal:
            print(f"   {refusal}", flush=True)
    return found


def find_pieces(scan):
    """Return the points of each piece of a scan, in words."""
    try:
        return [counts(scan.what[rows]) for rows in find_sheet(scan.points).leftovers.pieces]
    except O3DLeafError as refusal:
        return [str(refusal)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", metavar="NUMBER", type=int, nargs="*")
    parser.add_argument("--pressed", action="store_true", help="leaves pressed flat, without a table")
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    parser.add_argument("--blades", action="store_true", help="the blades of the whole scans, too")
    options = parser.parse_args()
    if options.pressed:
        drawn = [drawn_pressed(number, held_out=options.held_out) for number in options.numbers or range(60)]
        alarms = [f"{name}: {end}" for name, points in drawn if (end := outcome(points)) != "nothing"]
        print(
            f"{len(drawn)} pressed leaves, {len(alarms)} taken for a table{': ' if alarms else ''}{'; '.join(alarms)}"
        )
    else:
        ends = [run(number, options) for number in options.numbers or range(36)]
        print("; ".join(f"{ends.count(end)} {end}" for end in ("refused", "told", "nothing")))
