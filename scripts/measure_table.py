"""Leaves scanned with the table that they hang over: how much of a blade of both is stretched, and what becomes of it.

    python scripts/measure_table.py [--kinds KIND ...] [--gaps SPACINGS ...]

Printed of each scan are the shares of the area stretched below one half or above twice, each time that the surface has
settled with more smoothing, seconds, and the refusal or the blade's area.
"""

import argparse
import time

import numpy as np
from leaf_cases import KINDS
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.chart.flatten import WORST, _far
from o3dleaf.leaf.parametric import surface_fit

SPACING = 0.8
REACH = 2.0
"""Of the table, in those of the leaf."""
SHAPES = {"eaten": {"length": 40, "width": 16}, "lobed": {"length": 60, "width": 50}}


def with_table(points, gap):
    """Return a scan (n, 3) from above of a leaf and of a table, so many spacings below its lowest point."""
    points = points - [*points[:, :2].mean(axis=0), points[:, 2].min() - gap * SPACING]
    reach = REACH * np.abs(points[:, :2]).max(axis=0)
    plane = np.random.default_rng(1).uniform(-reach, reach, (int(4 * reach.prod() / SPACING**2), 2))
    seen = plane[cKDTree(points[:, :2]).query(plane)[0] > SPACING]
    return np.concatenate([points, np.column_stack([seen, np.zeros(len(seen))])])


def run(scan):
    """Return the shares stretched of each surface that settled, and what became of the blade."""
    shares, settle = [], surface_fit._settle  # noqa: SLF001

    def noted(*given):
        settled = settle(*given)
        shares.append(_far(settled.mesh.vertices, settled.mesh.triangles, settled.mesh.chart)[1])
        return settled

    surface_fit._settle = noted  # noqa: SLF001
    try:
        return shares, f"blade of {o3l.create_blade(scan, unit='mm').outline.area:.0f} mm²"
    except O3DLeafError as refusal:
        return shares, str(refusal)
    finally:
        surface_fit._settle = settle  # noqa: SLF001


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="*", default=list(SHAPES), choices=KINDS)
    parser.add_argument("--gaps", nargs="*", type=float, default=[0.0, 1.0, 3.0])
    options = parser.parse_args()
    print(f"shares stretched below {WORST[0]:g} or above {WORST[1]:g}, spacing {SPACING:g} mm")
    for kind in options.kinds:
        shape = {"kind": kind, **KINDS[kind], **SHAPES.get(kind, {})}
        points = o3l.samples.scan_leaf(o3l.samples.leaf_shape(**shape), seed=0, spacing=SPACING).points
        for gap in options.gaps:
            start = time.perf_counter()
            shares, end = run(with_table(points, gap))
            listed = ", ".join(f"{share:.3f}" for share in shares)
            print(f"{kind}, gap {gap:g}: {listed or 'none'}; {time.perf_counter() - start:.0f} s: {end}", flush=True)
