"""The samples as files: a scan, its midrib, a micro-CT volume, and a page that describes them."""

import hashlib
from os import PathLike
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Whole
from o3dleaf.core.atomic_files import make_folder, whole_file, write_text
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.ct.formats.tiff import write_volume
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.scan import wheat_scan

SCAN, MIDRIB, PATCH, PAGE = "wheat_scan.ply", "wheat_midrib.ply", "wheat_ct_24um.tif", "README.md"
DECIMALS_MM, DECIMALS_INTENSITY = 4, 5
"""What is kept of coordinates and intensities; far below the noise, far above the rounding of a machine."""

TEXT = """# Sample data

Made by `scripts/make_samples.py` (`o3dleaf sample DIR`, `o3dleaf.samples`) with seed {seed}: synthetic, no one else's
data, under the licence of the project. The truth behind each file is a Field that the same functions return.

| File | Unit | What it is |
|---|---|---|
| `{scan}` | mm | laser scan of a wheat leaf, {points:,} points: `samples.wheat_scan(seed={seed})`, noise 0.1 mm, two passes, holes; coordinates to 0.0001 mm |
| `{midrib}` | mm | {controls} hand-picked-like control points of its midrib, in order from the base |
| `{patch}` | µm | micro-CT patch of a wheat leaf, {shape} = {voxels:,} voxels of 24 µm along (x, y, z): `samples.wheat_ct(seed={seed})`; 32-bit intensities, air 0, leaf about 0.2, noise 0.01, to 0.00001; spacing, origin and unit in the ImageJ metadata |

| File | Bytes | SHA-256 |
|---|---|---|
{sums}
"""  # noqa: E501 - a row of a table is one line


@checked
def write_samples(folder: str | PathLike[str], *, seed: Whole = 0) -> list[Path]:
    """Write the sample scan, midrib and micro-CT volume with a README that holds their checksums.

    Parameters
    ----------
    folder : path-like
        Made if it does not exist; files of the same names are replaced.
    seed : int
        Of the samples; the files in `data_samples/` have 0.

    Returns
    -------
    paths : list of Path
        The files written.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    O3DLeafError
        If writing fails.
    """
    folder = make_folder(folder)
    scan = wheat_scan(seed=seed)
    volume, _ = wheat_ct(seed=seed)
    volume = Volume(volume.data.round(DECIMALS_INTENSITY), volume.spacing, volume.origin, volume.unit)
    paths = [folder / name for name in (SCAN, MIDRIB, PATCH)]
    write_points(paths[0], np.asarray(scan.cloud.points))
    write_points(paths[1], scan.midrib)
    write_volume(volume, paths[2])
    sums = [f"| `{p.name}` | {p.stat().st_size:,} | `{hashlib.sha256(p.read_bytes()).hexdigest()}` |" for p in paths]
    page = folder / PAGE
    text = TEXT.format(
        seed=seed,
        scan=SCAN,
        midrib=MIDRIB,
        patch=PATCH,
        points=len(scan.cloud.points),
        controls=len(scan.midrib),
        shape=" × ".join(str(n) for n in volume.shape),
        voxels=volume.data.size,
        sums="\n".join(sums),
    )
    write_text(text, page)
    return [*paths, page]


def write_points(path: Path, points: FloatArray) -> None:
    """Write (n, 3) points in millimeters, rounded, whole or not at all."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.round(DECIMALS_MM)))
    with whole_file(path, points.astype(np.float64).nbytes) as temporary:
        if not o3d.io.write_point_cloud(temporary, cloud):
            raise O3DLeafError(f"{path}: could not be written; check the folder's permissions and free space")
