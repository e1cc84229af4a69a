"""Measure what a picture costs and how far it is from one of many rays.

    python scripts/measure_picture.py [MESH ...] [--size 1600 1000] [--supersampling 3]

Without a mesh, of the synthetic leaf: the whole, and a closed piece of it from near. The reference casts sixteen times
as many rays, of both kinds, everywhere; differences are of luminance, in steps of a screen's 255, where the mesh is.
Beside the picture stands the one that takes every sample of every pixel.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from bench_field import make_leaf
from rich.console import Console
from rich.table import Table

from o3dleaf.io.triangle_mesh import read_triangle_mesh
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.picture import PAPER
from o3dleaf.output.view.scene import Scene, encode, linear
from o3dleaf.output.view.shade import CONTRAST, Shot, shade_mesh

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear RGB (IEC 61966-2-1)."""


def scenes(paths):
    """Yield names and meshes."""
    for path in paths:
        yield path.name, read_triangle_mesh(path)
    if not paths:
        leaf = make_leaf(quick=True)
        middle = leaf.blade.outline.polygon.representative_point()
        half = leaf.texture.period / leaf.scale / 2
        region = np.array([middle.x, middle.y]) + np.stack([-half, half])
        yield "leaf", leaf.extract_mesh(0.1)
        yield "closed piece", leaf.extract_mesh(float(half.min()) / 100, region, closed=True)


def shot_of(mesh, size, supersampling):
    scene, view = Scene.of(mesh), View(supersampling=supersampling)
    camera = Camera.framing(scene.vertices, scene.triangles, view, size[0] / size[1])
    return Shot(scene.vertices, scene.triangles, scene.paint, camera, size, view)


def shown(image):
    """Return the luminance on paper, 0 to 255."""
    return 255 * encode(linear(PAPER) * (1 - image[..., 3:]) + image[..., :3]) @ LUMINANCE


def measure(mesh, size, supersampling):
    """Yield rows: what was drawn, wall and processor seconds, RMS, 99.9th percentile and largest difference."""
    reference = shade_mesh(shot_of(mesh, size, 4 * supersampling), contrast=0.0)
    there = reference[..., 3] > 0
    for name, contrast in (("picture", CONTRAST), ("every sample", 0.0)):
        shot, wall, busy = shot_of(mesh, size, supersampling), time.perf_counter(), time.process_time()
        image = shade_mesh(shot, contrast)
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        off = np.abs(shown(image) - shown(reference))[there]
        yield name, wall, busy, float(np.sqrt(np.mean(off**2))), float(np.quantile(off, 0.999)), float(off.max())


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--size", nargs=2, type=int, default=(1600, 1000))
    parser.add_argument("--supersampling", type=int, default=View().supersampling)
    options = parser.parse_args(arguments)
    table = Table("scene", "drawn", "seconds", "processor", "RMS", "99.9 %", "largest")
    for scene, mesh in scenes(options.meshes):
        for name, *numbers in measure(mesh, tuple(options.size), options.supersampling):
            table.add_row(scene, name, *(f"{number:.2f}" for number in numbers))
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
