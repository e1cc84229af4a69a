"""Seedlings of two blades on a sheath: what `find_sheet` tells of them, whose points its pieces hold, their areas.

    python scripts/measure_seedlings.py [--held-out] [--blades] [NUMBER ...]

Printed of each scan are the points of either blade and of the sheath, and how many of each are in each of the pieces
that can be asked for; with `--blades` what `create_blade` says of the whole, and the areas of the first two pieces
against those of the blades.
"""

import argparse

import numpy as np

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.seedling import drawn_seedling


def run(number, options):
    """Print the lines of one scan."""
    seedling = drawn_seedling(number, held_out=options.held_out)
    scan = seedling.scan()
    wide, high = 2 * seedling.radius / seedling.spacing, seedling.height / seedling.spacing
    count = " + ".join(map(str, np.bincount(scan.leaf, minlength=3)))
    how = f"sheath {wide:.1f} spacings wide, {high:.1f} high, gap {seedling.gap:.0f}°, noise {seedling.noise:g}"
    print(f"{number:2d} {how}: {count} points", flush=True)
    sheet = find_sheet(scan.points)
    pieces = [np.bincount(scan.leaf[rows], minlength=3) for rows in sheet.leftovers.pieces]
    print(f"   {sheet.blades}; pieces {', '.join(' + '.join(map(str, held)) for held in pieces)}")
    for piece in (None, 1, 2) if options.blades else ():
        try:
            blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=piece))
        except O3DLeafError as refusal:
            print(f"   piece {piece}: {refusal}", flush=True)
            continue
        area = o3l.mesh_report(blade.extract_mesh(seedling.spacing)).area
        if piece is None:
            is_told = any("blades" in note for note in blade.notes)
            print(f"   made as one blade of {area:.0f} mm², {'told' if is_told else 'in silence'}", flush=True)
        else:
            leaf = int(pieces[piece - 1].argmax()) if piece <= len(pieces) else 0
            print(f"   piece {piece}: {area:.0f} of {scan.areas[leaf]:.0f} mm² of blade {leaf}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", metavar="NUMBER", type=int, nargs="*")
    parser.add_argument("--held-out", action="store_true", help="other seedlings, to be run once, at the end")
    parser.add_argument("--blades", action="store_true", help="the blades, too")
    options = parser.parse_args()
    for number in options.numbers or range(36):
        run(number, options)
