"""Triangles that a solver accepts: the closed leaf and a closed patch of four tiles, remeshed, beside MeshLab's way.

python scripts/measure_remeshing.py [--leaf MODEL] [--spacing MM ...] [--patch MM ...] [--peer] [--json FILE]

The leaf is the MODEL that `leaf.save` or `o3dleaf leaf --model` wrote, by default a small synthetic one. Each mesh
is polygonised, remeshed to edges of the same length, and judged: by `mesh_report`, and by the distance of every
vertex to the surface, in spacings: of a patch |G|/|∇G| on its faces, and in the plane to the outline on its rim;
of the leaf its signed distance. Seconds are those of remeshing, polygonising included, by all cores. Those
of MeshLab's isotropic remeshing (`--peer`), which knows no field, are of the same mesh of the leaf, by one core.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import pymeshlab
import shapely
from bench_field import make_leaf
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.io.labelled_mesh import RIM

COLUMNS = (
    "mesh",
    "made by",
    "triangles",
    "seconds",
    "closed",
    "crossing",
    "min angle",
    "< 10 deg",
    "99 % off",
    "most off",
)
"""Of the table; distances are in spacings."""


def distances(leaf, outline, vertices, triangles, labels):
    """Distance of each vertex of a patch to its surface: G = 0, and the wall over the outline where G > 0."""
    on_rim, on_face = np.zeros((2, len(vertices)), dtype=bool)
    on_rim[triangles[labels == RIM]] = True
    on_face[triangles[labels != RIM]] = True
    low, high = leaf.texture.cell[:, 2] / leaf.scale
    flat = leaf.blade.flatten(vertices)
    value = leaf(vertices) / np.linalg.norm(leaf.gradient(vertices), axis=1)
    # What the patch's top or bottom cuts is closed there, and is on no level of G.
    cut = (np.abs(flat[:, 2] - low) < 1e-9) | (np.abs(flat[:, 2] - high) < 1e-9)
    face = np.where(cut & (value > 0), 0.0, np.abs(value))
    wall = shapely.distance(outline.boundary, shapely.points(flat[:, :2])) + np.maximum(-value, 0)
    return np.minimum(np.where(on_face, face, np.inf), np.where(on_rim, wall, np.inf))


def figures(name, maker, spacing, seconds, mesh, off):
    """One row: what the report says, and how far the vertices are off, in spacings."""
    report = o3l.mesh_report(mesh)
    return {
        "mesh": name,
        "made_by": maker,
        "spacing": spacing,
        "triangles": report.triangles,
        "seconds": seconds,
        "watertight": report.watertight,
        "manifold": report.manifold,
        "oriented": report.oriented,
        "components": report.components,
        "self_intersections": report.self_intersections,
        "min_angle_deg": report.min_angle_deg,
        "share_below_10deg": report.share_below_10deg,
        "off_99pc": float(np.quantile(off, 0.99)) / spacing,
        "off_max": float(off.max()) / spacing,
    }


def by_meshlab(mesh, edge):
    """MeshLab's isotropic explicit remeshing, to the same edge, within a tenth of it."""
    session = pymeshlab.MeshSet(verbose=False)
    session.add_mesh(pymeshlab.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles)))
    start = time.perf_counter()
    session.meshing_isotropic_explicit_remeshing(
        iterations=5,
        targetlen=pymeshlab.PureValue(edge),
        checksurfdist=True,
        maxsurfdist=pymeshlab.PureValue(edge / 10),
    )
    seconds = time.perf_counter() - start
    found = session.current_mesh()
    return (found.vertex_matrix(), found.face_matrix()), seconds


def rows_of(leaf, name, spacing, region, peer):
    """Yield the figures of one mesh as polygonised, remeshed, and by MeshLab."""
    surface = leaf.plan_mesh(spacing, region, closed=True)
    raw = surface.extract()
    start = time.perf_counter()
    found = surface.extract(remesh=spacing)
    seconds = time.perf_counter() - start
    for maker, each, took in (("polygonised", raw, 0.0), ("remeshed", found, seconds)):
        vertices, triangles = np.asarray(each.mesh.vertices), np.asarray(each.mesh.triangles)
        if region is None:
            off = np.abs(leaf.signed_distance(vertices, closed=True))
        else:
            off = distances(leaf, surface.outline, vertices, triangles, each.labels)
        yield figures(name, maker, spacing, took, each.mesh, off)
    if peer and region is None:
        (vertices, triangles), took = by_meshlab(raw.mesh, spacing)
        off = np.abs(leaf.signed_distance(vertices, closed=True))
        yield figures(name, "MeshLab", spacing, took, (vertices, triangles), off)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--leaf", type=Path, help="a model of a leaf, in any unit")
    parser.add_argument("--spacing", type=float, nargs="*", default=[0.1], help="of the whole leaf, in its unit")
    parser.add_argument("--patch", type=float, nargs="*", default=[0.1, 0.024], help="of four tiles, in its unit")
    parser.add_argument("--peer", action="store_true", help="run MeshLab too")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    leaf = make_leaf(quick=True) if options.leaf is None else o3l.load(options.leaf)
    middle = leaf.blade.outline.polygon.representative_point()
    half = leaf.texture.period / leaf.scale
    region = np.array([middle.x, middle.y]) + np.stack([-half, half])
    jobs = [("four tiles", each, region) for each in options.patch] + [("leaf", each, None) for each in options.spacing]
    rows = [row for name, spacing, part in jobs for row in rows_of(leaf, name, spacing, part, options.peer)]
    table = Table(*COLUMNS)
    for row in rows:
        table.add_row(
            f"{row['mesh']}, {1000 * row['spacing']:g} µm"
            if leaf.unit == "mm"
            else f"{row['mesh']}, {row['spacing']:g}",
            row["made_by"],
            f"{row['triangles']:,}",
            f"{row['seconds']:.1f}" if row["seconds"] else "",
            "yes" if row["watertight"] else "no",
            str(row["self_intersections"]),
            f"{row['min_angle_deg']:.3g}",
            f"{100 * row['share_below_10deg']:.3g} %",
            f"{row['off_99pc']:.2g}",
            f"{row['off_max']:.2g}",
        )
    Console(width=140).print(table)
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
