"""Cases of a droplet on a plate, and what a solver would have written of a spherical cap on it."""

import numpy as np
from skimage.measure import marching_cubes

from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.output.droplet.box import DropletBox
from o3dleaf.output.droplet.case import DropletCase
from o3dleaf.output.droplet.surfaces import grid_solid
from o3dleaf.output.droplet.units import Impact

CELL = 5e-5
"""Meters."""
STEP = 2.0
"""Cells of the cap, in the solver's unit of length; the ball's radius is 30."""


def plate(ridges=0.0, size=1.2e-3):
    """A flat solid, its upper face z = 0, in meters, or with ridges of that height askew to its cells."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, 121 if ridges else 13)] * 2, indexing="ij")
    upper = ridges * np.cos(2 * np.pi * (0.95 * x + 0.3 * y) / 2e-4)
    faces = [np.column_stack([x.ravel(), y.ravel(), z.ravel()]) for z in (upper, np.full(x.shape, -3e-4))]
    triangles, labels = grid_solid(*x.shape)
    return LabelledMesh(build_mesh(np.concatenate(faces), triangles), labels, unit="m")


def write_plate(folder, impact=None, cell=CELL, duration=1e-4, variants=("leaf", "twin"), ridges=0.0):
    impact = impact or Impact()
    box = DropletBox.around(np.array([[0.0, 0.0, ridges]]), impact, 1.2e-3, cell)
    folder.mkdir(parents=True, exist_ok=True)
    case = DropletCase(impact, box, duration, 5e-5, {"title": "a plate"})
    case.write(folder, dict.fromkeys(variants, plate(ridges)))
    return case


def cap(angle, radius=30.0, shift=(0.0, 0.0)):
    """Return a spherical cap on z = 0 as its share of each cell, and the coordinates of the cells' middles."""
    ticks = [np.arange(-44, 44, STEP) + STEP / 2] * 2 + [np.arange(0, 64, STEP) + STEP / 2]
    fine = (np.arange(4) - 1.5) * STEP / 4
    share = np.zeros([len(each) for each in ticks])
    middle = (*shift, -radius * np.cos(np.radians(angle)))
    for dx in fine:
        for dy in fine:
            for dz in fine:
                x, y, z = np.meshgrid(ticks[0] + dx, ticks[1] + dy, ticks[2] + dz, indexing="ij", sparse=True)
                share += (x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2 < radius**2
    return share / 64, ticks


def write_run(folder, shares, ticks, times, start="0"):
    """Write what the case's function objects would of these fields, as OpenFOAM does."""
    results = folder / "postProcessing"
    rows = {"volume": [], "contact": [], "velocity": [], "bounds": []}
    for time, share in zip(times, shares, strict=True):
        # At the wall a field has what its boundary condition makes of the two layers above.
        wall = np.clip(1.5 * share[:, :, 0] - 0.5 * share[:, :, 1], 0, 1)
        rows["volume"].append(f"{time:g}\t{share.sum() * STEP**3:.12e}")
        rows["contact"].append(f"{time:g}\t{wall.sum() * STEP**2:.12e}")
        rows["velocity"].append(f"{time:g}\t(1e-3 -2e-3 {-0.5 + 0.01 * time:.12e})")
        rows["bounds"].append(f"{time - 0.5:g}\t{-1e-9 * time:.12e}\t{1 + 1e-9:.12e}\t0\t{time:.12e}")
        rows["bounds"].append(f"{time:g}\t{-2e-9 * time:.12e}\t1\t0\t{0.5 * time:.12e}")
        place = results / "interface" / f"{time:g}"
        place.mkdir(parents=True, exist_ok=True)
        vertices, triangles, _, _ = marching_cubes(np.pad(share, ((0, 0), (0, 0), (1, 0)), mode="edge"), 0.5)
        vertices = vertices * STEP + [ticks[0][0], ticks[1][0], ticks[2][0] - STEP]
        lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
        (place / "droplet.obj").write_text("\n".join([*lines, ""]))
    for name, text in rows.items():
        place = results / name / start
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{name}.dat").write_text("\n".join(["# Time\tof this", *text, ""]))
