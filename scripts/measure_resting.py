"""Leaves that rest on one another or cross, of known shape: which points `find_sheet` gives to which, what it says.

    python scripts/measure_resting.py [--crossing | --fragments] [--held-out] [--blades] [NUMBER ...]

Printed of each scan are the points of the lower and the upper leaf on the sheet of the whole scan and on each of the
pieces that can be asked for, and with `--blades` the area of the blade of the first two against that of the leaf as
it is seen. Of a fragment of another leaf it is the area of the blade of the whole scan against that of the leaf that it
lies on, as seen, and how much of the blade is farther than two spacings from that leaf's points.
"""

import argparse

import numpy as np
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.crossing import drawn_crossing
from o3dleaf.samples.leaves.resting import drawn_fragment, drawn_leaves

SPACING = 0.8
FAR = 2.0
"""Spacings from the points of a leaf from which on a place of a blade is none of it, nor between them."""


def run(number, options):
    """Print the lines of one scan."""
    drawn = drawn_crossing if options.crossing else drawn_fragment if options.fragments else drawn_leaves
    leaves = drawn(number, held_out=options.held_out)
    scan = leaves.scan()
    count = np.bincount(scan.leaf)
    if options.crossing:
        how = f"{leaves.angle:.0f}°, tilt {leaves.tilt:.0f}°, density {leaves.density:g}"
    else:
        how = "tip" if leaves.tip else "middle"
    how += ", above" if leaves.hidden else ", full"
    print(f"{number:2d} {how}, gap {leaves.gap:g}, noise {leaves.noise:g}: {count[0]} + {count[1]} points", flush=True)
    sheet = find_sheet(scan.points)
    pieces = [np.bincount(scan.leaf[rows], minlength=2) for rows in sheet.leftovers.pieces]
    shown = ", ".join(f"{one} + {other}" for one, other in pieces)
    one, other = np.bincount(scan.leaf[sheet.rows], minlength=2)
    print(f"   whole {one} + {other}; pieces {shown}")
    for note in sheet.notes:
        if "two leaves" in note:
            print(f"   {note}")
    if options.fragments:
        print(f"   {blade_beside(scan)}")
        return
    for piece, held in enumerate(pieces[:2] if options.blades else [], 1):
        leaf = int(held.argmax())
        try:
            blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=piece))
            area = o3l.mesh_report(blade.extract_mesh(SPACING)).area
            print(f"   piece {piece}: {area / scan.areas[leaf] - 1:+.1%} of the area of leaf {leaf} as seen")
        except O3DLeafError as refusal:
            print(f"   piece {piece}: {refusal}")


def blade_beside(scan):
    """Return a line on the blade of a scan of a leaf with a fragment on it."""
    try:
        mesh = o3l.create_blade(scan.points, unit="mm").extract_mesh(SPACING / 2)
    except O3DLeafError as refusal:
        return str(refusal)
    away = cKDTree(scan.points[scan.leaf == 0]).query(np.asarray(mesh.vertices))[0] / SPACING
    area = o3l.mesh_report(mesh).area / scan.areas[0] - 1
    off = f"{np.mean(away > FAR):.2%} off it, up to {away.max():.1f} spacings"
    return f"blade: {area:+.2%} of the area of the leaf as seen, {off}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", metavar="NUMBER", type=int, nargs="*")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--crossing", action="store_true", help="leaves that cross")
    kind.add_argument("--fragments", action="store_true", help="fragments of another leaf on one")
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    parser.add_argument("--blades", action="store_true", help="the blades of both leaves, too")
    options = parser.parse_args()
    for number in options.numbers or range(64 if options.fragments else 36 if options.crossing else 16):
        run(number, options)
