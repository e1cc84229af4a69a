"""What the report of a mesh of ten million triangles takes, stage by stage, beside MeshLab's own filters.

python scripts/measure_report.py [--leaf MODEL] [--triangles N] [--meshlab]

On four meshes: the closed leaf (of MODEL, a saved leaf in millimetres, or of the synthetic samples); a wavy sheet
whose steps shrink from 1 to 1e-4 along both axes, its vertices and triangles shuffled, with 2,000 large triangles
through it; a flat slanted grid, in which every determinant is rounding; and triangles of sizes from 1 to 1e-4 at
random places, none with a neighbour. Compilation is not counted, nor is making the mesh. MB is what the process held
beyond the mesh; processor time is that of all threads. MeshLab is asked about the leaf alone: on 300,000 triangles of
the uneven sheet it had found no answer in half a minute.
"""

import argparse
import os
import platform
import time

import numpy as np
import pymeshlab
from measuring import measure, resident
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core import progress
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.scan import wheat_scan

STAGES = ("edges", "pieces and fans", "measures", "loops, orientation", "crossings")


def leaf_mesh(model, triangles):
    """Return the closed leaf with about so many triangles."""
    if model:
        leaf = o3l.load(model)
    else:
        sample = wheat_scan()
        leaf = o3l.create_multiscale_leaf(sample.cloud, wheat_ct()[0], sample.midrib)
    coarse = leaf.plan_mesh(0.2, closed=True).triangles
    return mesh_arrays(leaf.plan_mesh(0.2 * np.sqrt(coarse / triangles), closed=True).extract().mesh)


def grid(x, y, height):
    """Return the triangles of a height map over two axes."""
    across, along = np.meshgrid(x, y, indexing="ij")
    vertices = np.stack([across, along, height(across, along)], axis=-1).reshape(-1, 3)
    rows = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    a, b, c, d = (part.ravel() for part in (rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]))
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def uneven(triangles, rng):
    """Return the sheet of shrinking steps, shuffled, and the large triangles through it."""
    axis = np.geomspace(1e-4, 1, round(np.sqrt(triangles / 2)))
    vertices, rows = grid(axis, axis, lambda x, y: 0.1 * np.sin(9 * x) * np.cos(7 * y))
    rows = np.concatenate([rows, len(vertices) + np.arange(6000).reshape(-1, 3)])
    vertices = np.concatenate([vertices, rng.uniform(-1, 2, (6000, 3))])
    place = rng.permutation(len(vertices))
    return vertices[place], np.argsort(place)[rows][rng.permutation(len(rows))]


def flat(triangles):
    """Return the slanted plane."""
    axis = np.linspace(0, 1, round(np.sqrt(triangles / 2)))
    return grid(axis, axis, lambda x, y: 0.3 * x + 0.7 * y)


def soup(triangles, rng):
    """Return triangles without neighbours."""
    size = 0.01 * 10.0 ** (-4 * rng.random((triangles, 1, 1)))
    corners = rng.random((triangles, 1, 3)) + size * rng.normal(size=(triangles, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * triangles).reshape(-1, 3)


def meshlab_crossings(mesh):
    """Return how many triangles cross a triangle that they share no edge or vertex with, says MeshLab's filter."""
    session = pymeshlab.MeshSet(verbose=False)
    vertices, triangles = mesh_arrays(mesh)
    session.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32)))
    session.compute_selection_by_self_intersections_per_face()
    return session.current_mesh().selected_face_number()


def report_row(name, mesh, *, meshlab=False):
    """Return one line of the table: seconds of each stage, of all, of the processors, and megabytes."""
    ends = [time.perf_counter()]
    before = time.process_time()
    with progress.listening(lambda *_: ends.append(time.perf_counter())):
        report, seconds, peak = measure(lambda: o3l.mesh_report(mesh))
    spent = time.process_time() - before
    row = [name, f"{report.triangles:,}", f"{report.self_intersections:,}"]
    row += [f"{stage:.1f}" for stage in np.diff(ends)] + [f"{seconds:.1f}", f"{spent:.0f}", f"{peak:.0f}"]
    if meshlab:
        count, seconds, _ = measure(lambda: meshlab_crossings(mesh))
        row += [f"{count:,}", f"{seconds:.1f}"]
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaf", metavar="MODEL", help="a leaf that was saved, in millimetres")
    parser.add_argument("--triangles", type=int, default=10_000_000, metavar="N")
    parser.add_argument("--meshlab", action="store_true", help="run MeshLab's filter on the leaf as well")
    options = parser.parse_args()
    rng, many = np.random.default_rng(0), options.triangles
    meshes = {
        "closed leaf": lambda: leaf_mesh(options.leaf, many),
        "uneven, shuffled": lambda: uneven(many, rng),
        "flat, slanted": lambda: flat(many),
        "no neighbours": lambda: soup(many, rng),
    }
    o3l.mesh_report(soup(1000, rng))
    table = Table(title=f"mesh_report, {os.cpu_count()} cores, Python {platform.python_version()}")
    more = ("MeshLab's crossings", "its [s]") if options.meshlab else ()
    for column in (
        "mesh",
        "triangles",
        "crossing",
        *(f"{name} [s]" for name in STAGES),
        "all [s]",
        "cpu [s]",
        "MB",
        *more,
    ):
        table.add_column(column, justify="right")
    for name, make in meshes.items():
        table.add_row(*report_row(name, make(), meshlab=options.meshlab and name == "closed leaf"))
    Console(width=200 if not os.isatty(1) else None).print(table)
    print(f"{resident():.0f} MB at the end")


if __name__ == "__main__":
    main()
