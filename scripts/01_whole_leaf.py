"""The whole job in three calls: a scan and a volume in, a mesh and a picture out.

python scripts/01_whole_leaf.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

import open3d as o3d

import o3dleaf as o3l

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"


def main(folder):
    scan = o3d.io.read_point_cloud(SAMPLES / "wheat_scan.ply")
    volume = o3l.read_volume(SAMPLES / "wheat_ct_24um.tif")

    # Midrib, smoothing, outline and threshold are all found from the data.
    leaf = o3l.create_multiscale_leaf(scan, volume, unit="mm")

    # A window of the leaf, 3 mm by 3 mm half-way along it, at the step of the CT.
    mesh = leaf.extract_mesh(spacing=0.024, region=[[100, -1.5], [103, 1.5]])
    o3l.write_mesh(mesh, folder / "window.ply")
    o3l.view.render(mesh, folder / "window.png", unit="mm")
    return leaf, mesh


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    made = main(where)[1]
    print(f"{where / 'window.ply'}: {len(made.triangles):,} triangles")
