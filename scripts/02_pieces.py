"""The same leaf from its pieces, each of which can be looked at, replaced or used alone.

python scripts/02_pieces.py
"""

from pathlib import Path

import numpy as np
import open3d as o3d

import o3dleaf as o3l

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"


def main():
    # Macro-scale: frame along the midrib, height map over the flattened blade, outline.
    scan = o3d.io.read_point_cloud(SAMPLES / "wheat_scan.ply")
    midrib = o3d.io.read_point_cloud(SAMPLES / "wheat_midrib.ply")
    frame = o3l.LeafFrame.fit(scan, midrib, unit="mm")
    leaf_points = frame.to_leaf(np.asarray(scan.points))
    height = o3l.HeightMap.fit(leaf_points, unit="mm")
    outline = o3l.AlphaShape(leaf_points[:, :2])

    # Micro-scale: threshold, voxels as samples, an implicit interpolant with the paper's rho, tiles.
    volume = o3l.read_volume(SAMPLES / "wheat_ct_24um.tif")
    level = volume.threshold()
    transform = o3l.align_blade(volume, level)
    points, values = volume.to_samples(level, transform=transform)
    micro = o3l.PUInterpolant.fit(points, values, rho=3e-5, unit=volume.unit)
    texture = o3l.TiledField(micro, period=(1600, 1600))  # micrometres, like the points it was fitted to

    # Together: one function G of world points, zero on the surface, with its gradient.
    leaf = o3l.MultiscaleLeaf(texture, frame, height, outline)
    above, inside = leaf.blade.lift([[100.0, 0.0, 0.25], [100.0, 0.0, 0.0]])
    return leaf, leaf([above, inside]), leaf.gradient([inside])


if __name__ == "__main__":
    _, found, _ = main()
    print(f"G is {found[0]:.3f} a quarter of a millimetre above the blade and {found[1]:.3f} inside it")
