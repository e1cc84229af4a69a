"""Scans of leaves of known shape as files."""

from os import PathLike
from pathlib import Path

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Whole
from o3dleaf.core.atomic_files import make_folder
from o3dleaf.samples.files import write_points
from o3dleaf.samples.leaves.kinds import LEAF_KINDS, leaf_shape
from o3dleaf.samples.leaves.leaf_scan import scan_leaf

NOISE = 0.2
"""Of the scans, in spacings: what a laser scanner leaves."""


@checked
def write_leaf_scans(folder: str | PathLike[str], *, seed: Whole = 0) -> list[Path]:
    """Write a scan of each kind of leaf, ``leaf_KIND.ply``, in millimeters: `scan_leaf` with a noise of 0.2 spacings.

    Parameters
    ----------
    folder : path-like
        Made if it does not exist; files of the same names are replaced.
    seed : int

    Returns
    -------
    paths : list of Path
        The files written.

    Raises
    ------
    O3DLeafError
        If writing fails.
    """
    folder = Path(folder)
    make_folder(folder)
    paths = [folder / f"leaf_{kind}.ply" for kind in LEAF_KINDS]
    for kind, path in zip(LEAF_KINDS, paths, strict=True):
        write_points(path, np.asarray(scan_leaf(leaf_shape(kind), noise=NOISE, seed=seed).cloud.points))
    return paths
