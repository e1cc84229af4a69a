"""Which leaves with deep lobes, and which that cross flush, one hidden by the other, are told as leaves that cross.

    python scripts/measure_lobes.py [--held-out]

Of lobes it is wrong, of leaves that cross flush right; nothing but their outline tells either.
"""

import argparse

from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.crossing import drawn_flush
from o3dleaf.samples.leaves.lobes import LOBES, drawn_lobes

COUNT = 36


def told(points):
    """Return the lines on two leaves."""
    return [note for note in find_sheet(points).notes if "two leaves" in note]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--held-out", action="store_true", help="others, to be run once, at the end")
    held_out = parser.parse_args().held_out
    for name, points in (
        ("lobes", lambda number: drawn_lobes(number, held_out=held_out).points),
        ("flush", lambda number: drawn_flush(number, held_out=held_out).scan().points),
    ):
        lines = [told(points(number)) for number in range(COUNT)]
        outline = sum(any("by their outline" in line for line in each) for each in lines)
        print(f"{name}: {sum(map(bool, lines))} of {COUNT} told, {outline} of them by their outline alone")
        if name == "lobes":
            print(f"   with lobes: {[LOBES[number % 6] for number, each in enumerate(lines) if each]}")
