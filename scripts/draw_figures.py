"""Draw the figures of the docs: `o3dleaf figures` of the real wheat leaf, made small for a page on a screen.

    python scripts/draw_figures.py [-o docs/images]

The scan is the real wheat leaf where ../shared/data has it, else the sample; the CT patch is that of data_samples/.
"""

import argparse
import tempfile
from pathlib import Path

from PIL import Image

from o3dleaf.commands.figures import FiguresJob
from o3dleaf.core.journal import Journal

ROOT = Path(__file__).resolve().parents[1]
REAL, SAMPLES = ROOT.parent / "shared" / "data" / "wheat", ROOT / "data_samples"
SHOWN = ("scan", "flattened", "height-map", "histogram", "tile", "four-tiles", "cross-section", "whole-leaf")
WIDTH, COLOURS = 720, 128


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "images")
    output = parser.parse_args().output
    scan, midrib = REAL / "wheat_leaf.ply", REAL / "wheat_leaf_midrib.ply"
    if not scan.is_file():
        scan, midrib = SAMPLES / "wheat_scan.ply", SAMPLES / "wheat_midrib.ply"
    with tempfile.TemporaryDirectory() as name:
        ct = SAMPLES / "wheat_ct_24um.tif"
        job = FiguresJob(scan, Path(name), ct, midrib=midrib, formats="png", only=",".join(SHOWN))
        with Journal() as journal:
            drawn = job.run()
        for path in drawn.paths[:-1]:
            with Image.open(path) as page:
                small = page.convert("RGB").resize((WIDTH, round(page.height * WIDTH / page.width)), Image.LANCZOS)
            target = output / f"figure_{path.stem.replace('-', '_')}.png"
            small.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
            print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")
        print(drawn.paths[-1].read_text())
    print(f"{sum(journal.seconds.values()):.1f} s in all:")
    for stage, seconds in journal.seconds.items():
        print(f"{stage:>28} {seconds:6.1f} s")


if __name__ == "__main__":
    main()
