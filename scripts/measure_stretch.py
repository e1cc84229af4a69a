"""How a blade's chart stretches its surface: lengths in the chart over lengths on the blade.

python scripts/measure_stretch.py [--kinds ...] [--conditions ...] [--real FILE ...] [--reconstruct]

Of each leaf the surface inside its margin is meshed in about 6,000 triangles, and of their maps to the chart the
smaller singular value that 1 % of the area falls short of is printed, and the larger one that 1 % exceeds. Beside it
the same of that mesh laid flat as rigidly as possible: no chart of the surface has much less. With --reconstruct also
that of the largest piece of `reconstruct`, decimated to 6,000 triangles and laid flat, where it is a sheet.
"""

import argparse

import numpy as np
from leaf_cases import CONDITIONS, KINDS, cases

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.mesh_arrays import drop_unused_vertices, mesh_arrays
from o3dleaf.leaf.chart.flatten import coarsen, lay_flat
from o3dleaf.leaf.chart.flattening.embedding import relax_rigidly
from o3dleaf.leaf.chart.flattening.stretch import stretch_quantiles
from o3dleaf.leaf.margin.sheet_mesh import triangulate
from o3dleaf.surface.mesh.components import largest_component

TRIANGLES = 6000


def measure(name, points, unit, *, reconstruct):
    """Print the line of one leaf."""
    try:
        blade = o3l.create_blade(points, unit=unit)
    except O3DLeafError as cause:
        print(f"{name}: {cause}", flush=True)
        return
    step = np.sqrt(blade.outline.area / TRIANGLES * 4 / np.sqrt(3))
    plane, triangles = triangulate(blade.outline.polygon, step)
    space = blade.lift(np.column_stack([plane, np.zeros(len(plane))]))
    flat = relax_rigidly(space, triangles, plane)
    said = f"{name}: blade {shown(space, triangles, plane)}, laid flat {shown(space, triangles, flat)}"
    print(said + (f", reconstruct {of_reconstruct(points)}" if reconstruct else ""), flush=True)


def shown(vertices, triangles, chart):
    """Return the stretch of a chart as text."""
    stretch = stretch_quantiles(vertices, triangles, chart)
    return f"{stretch.least:.3f} to {stretch.most:.3f}"


def of_reconstruct(points):
    """Return the stretch of the largest piece of a reconstruction, laid flat, as text; or why there is none."""
    try:
        mesh = largest_component(o3l.create_from_point_cloud_rbfpu(points)[0])[0]
        sheet = coarsen(*drop_unused_vertices(*mesh_arrays(mesh)))
        return shown(*sheet, lay_flat(*sheet))
    except O3DLeafError as cause:
        return f"none ({cause})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="*", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=["clean", "noise 0.5"])
    parser.add_argument("--real", nargs="+", default=[], metavar="FILE", help="scans, in millimeters or in meters")
    parser.add_argument("--reconstruct", action="store_true", help="the mesh of `reconstruct` as well")
    options = parser.parse_args()
    for case in cases(options.kinds, options.conditions, 1):
        measure(f"{case.name}, {case.condition}", case.scan().points, "mm", reconstruct=options.reconstruct)
    for path in options.real:
        points = np.asarray(o3l.read_point_cloud(path).points)
        unit = "m" if np.ptp(points, axis=0).max() < 1 else "mm"
        measure(path, points, unit, reconstruct=options.reconstruct)


if __name__ == "__main__":
    main()
