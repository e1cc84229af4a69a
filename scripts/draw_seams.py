"""Draw the seams of a patch whose width holds no whole number of ridges: tiled plainly, by the best period, laid.

    python scripts/draw_seams.py [--ridges 5.5] [--seed 1] [--spacing 16] [-o docs/images]

The patch is synthetic (`o3dleaf.samples.wheat_ct`, 1.68 mm at 24 µm, with noise and drift), fitted as
`create_texture` does. Both tilings, and sixteen Wang tiles of it, are meshed around a corner where four tiles meet and
drawn with the same camera, the adaxial side up; ridges run from left to right, a seam along them through the middle.
The seam energies are printed: of the faces that meet, or of the cuts, by the same measure.
The Wang tiles are drawn once more, their hairs thinned out by a map.
"""

import argparse
import time
from pathlib import Path

import numpy as np

import o3dleaf as o3l
from o3dleaf.output.view.camera import View

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
FROM_ABOVE = View(direction=(0.0, -0.75, 1.0), tilt=0.0)
PIECE = (3000.0, 2000.0)
"""Along and across, in µm."""
SIZE = (900, 540)


def tile_of(laid):
    return getattr(laid, "tile", laid.period)


def draw(tiled, spacing, title, path):
    # Around a corner where four tiles meet.
    centre, half, depth = tiled.cell[0, :2] + tile_of(tiled), 0.5 * np.array(PIECE), tiled.cell[:, 2]
    box = np.array([[*(centre - half), depth[0] - spacing], [*(centre + half), depth[1] + spacing]])
    mesh = o3l.extract_isosurface(tiled, spacing, box)
    o3l.view.render(mesh, path, size=SIZE, unit=tiled.unit, title=title, view=FROM_ABOVE)
    print(f"{path.name}: {len(mesh.triangles):,} triangles, {path.stat().st_size / 1000:.0f} kB")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ridges", type=float, default=5.5, help="ridges in the width of the patch")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--spacing", type=float, default=16.0, help="mesh step in µm")
    parser.add_argument("-o", "--output", type=Path, default=IMAGES)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    volume, truth = o3l.samples.wheat_ct(ridges=options.ridges, seed=options.seed)
    plain = o3l.create_texture(volume)
    o3l.TiledField(plain.field, "best")  # compiled, if it was not
    start = time.perf_counter()
    best = o3l.TiledField(plain.field, "best")
    seconds = time.perf_counter() - start
    middle = time.perf_counter()
    wang = o3l.WangField(plain.field, seed=options.seed)
    cutting = time.perf_counter() - middle
    pitch = float(np.diff(truth.bounds[:, 1])[0]) / truth.ridges
    print(f"{'seam energy':>14}{'along':>10}{'across':>10}{'total':>10}   tile, µm")
    for name, tiled in (("plain", plain), ("best", best), ("wang", wang)):
        energy, tile = tiled.seam_energy(), tile_of(tiled)
        print(f"{name:>14}{energy.along:>10.4f}{energy.across:>10.4f}{energy.total:>10.4f}", end="   ")
        print(f"{tile[0]:.1f} × {tile[1]:.1f}, {tile[1] / pitch:.3f} ridges")
    print(f"best / plain {best.seam_energy().total / plain.seam_energy().total:.3f}; searched in {seconds:.2f} s")
    print(f"wang / plain {wang.seam_energy().total / plain.seam_energy().total:.3f}; cut in {cutting:.2f} s")
    laid = (("plain", "Plain tiling", plain), ("best", 'period="best"', best), ("wang", "Wang tiles", wang))
    for name, word, tiled in laid:
        title = f"{word}: {tile_of(tiled)[1] / pitch:.2f} ridges a tile"
        draw(tiled, options.spacing, title, options.output / f"seams_{name}.png")
    middle, half = wang.cell[0, :2] + wang.period, 0.5 * np.array(PIECE)
    thinned = o3l.ThinnedField(wang, [[1.0], [1.0], [0.0], [0.0]], [middle - half, middle + half], seed=options.seed)
    title = f"Wang tiles, hairs thinned out from left to right: {thinned.hairs.counts[0]} of {thinned.hairs.counts[1]}"
    draw(thinned, options.spacing, title, options.output / "hairs_thinned.png")


if __name__ == "__main__":
    main()
