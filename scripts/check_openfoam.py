"""What OpenFOAM says of our meshes: surfaceCheck on closed surfaces, snappyHexMesh and checkMesh in the air around.

python scripts/check_openfoam.py                              # four tiles, the leaf and one tile of the samples
python scripts/check_openfoam.py --model leaf.o3l             # the same of your leaf
python scripts/check_openfoam.py a.ply b.stl --unit mm        # surfaceCheck on meshes of yours
python scripts/check_openfoam.py --snap tile.ply --unit mm    # a case around a closed mesh of yours; --period: above it

The leaf and the tiles around are remeshed to edges of their mesh step, as a solver wants them, unless --no-remesh is
given; the walls of the one tile must match, and it stays as it is.

Each surface is written in metres: as OBJ with a group for each label, which OpenFOAM reads in double precision, or with
--stl as ASCII STL with a solid for each (in single precision). The case is the template openfoam_case beside this
script, with a leafDict of its own; -o keeps it, with the logs. Exit code 1: OpenFOAM objects; 2: it is not there.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import open3d as o3d

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.output.export.consumers import enclosed_volume

HERE = Path(__file__).resolve().parent
SAMPLES = HERE.parent / "data_samples"
DEBIAN = Path("/usr/share/openfoam")
TOOLS = ("surfaceCheck", "blockMesh", "surfaceFeatureExtract", "snappyHexMesh", "createPatch", "checkMesh")
LEVEL = 2
MARGIN = 4
"""Background cells between the surface and the box."""
ON_SURFACE, VOLUME, WEIGHT = 0.1, 0.02, 0.5
"""How far 99 % of the snapped points may be from the surface, in cells beside it; how wrong its volume;
how much of each face of a cyclic side must find its like."""


@dataclass
class Verdict:
    """What was found of one surface or case, and which of it is wrong."""

    name: str
    found: dict[str, str] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def note(self, what, value, *, good=True):
        self.found[what] = str(value)
        if not good:
            self.wrong.append(what)

    def __str__(self):
        lines = [f"{self.name}: {'FAILED: ' + ', '.join(self.wrong) if self.wrong else 'passed'}"]
        return "\n".join([*lines, *(f"    {what:<34} {value}" for what, value in self.found.items())])


def run(folder, *command):
    """Run a tool of OpenFOAM; return its output, and whether it ended well."""
    environment = dict(os.environ)
    if "WM_PROJECT_DIR" not in environment and (DEBIAN / "etc" / "controlDict").is_file():
        environment["WM_PROJECT_DIR"] = str(DEBIAN)
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    text = done.stdout + done.stderr
    (folder / f"log.{command[0]}").write_text(text)
    return text, done.returncode == 0 and "FOAM FATAL" not in text


def number(pattern, text):
    """Return the number that a pattern finds, or None."""
    match = re.search(pattern, text)
    return float(match.group(1).rstrip(",.")) if match else None


def check_surface(name, mesh, folder, suffix):
    """Return what surfaceCheck says of a closed surface."""
    verdict, folder = Verdict(f"surfaceCheck {name}"), folder / name
    folder.mkdir(parents=True)
    try:
        o3l.export_mesh(mesh, folder / f"leaf{suffix}", consumer="openfoam")
    except o3l.errors.InputError as error:
        verdict.note("exported", error, good=False)
        return verdict
    judge_surface(verdict, *run(folder, "surfaceCheck", f"leaf{suffix}"))
    return verdict


def judge_surface(verdict, text, well):
    """Note what a log of surfaceCheck says."""
    verdict.note("ended well", well, good=well)
    triangles = number(r"Triangles +: (\d+)", text)
    verdict.note("triangles", f"{triangles or 0:,.0f}")
    for line in re.findall(r"^(adaxial|abaxial|rim)\t(\d+)$", text, re.MULTILINE):
        verdict.note(f"    {line[0]}", f"{int(line[1]):,}")
    legal = "Surface has no illegal triangles." in text
    illegal = number(r"Surface has (\d+) illegal triangles", text)
    verdict.note("illegal triangles", 0 if legal else illegal, good=legal)
    closed = "Surface is closed." in text
    verdict.note("closed", closed, good=closed)
    zones = number(r"consistent normal\) : (\d+)", text)
    verdict.note("zones of one orientation", zones and int(zones), good=zones == 1)
    parts = number(r"unconnected parts : (\d+)", text)
    verdict.note("unconnected parts", parts and int(parts))
    least, poor = number(r"    min (\S+) for triangle", text), number(r"0 .. 0.05 +: (\S+)", text)
    verdict.note("quality: least, share below 0.05", f"{least}, {poor}")
    verdict.note("shortest edge, m", number(r"min (\S+) for edge", text))
    verdict.note("points nearer than 1e-6 of the box", int(number(r"Found (\d+) nearby points", text) or 0))


def write_case(mesh, folder, cell, *, period=False):
    """Copy the template and give it a leafDict for a mesh in metres; return the finest cell and the box's volume.

    Over one period, the box is as wide as the mesh.
    """
    vertices, triangles = mesh_arrays(mesh)
    if cell is None:
        edges = vertices[triangles] - vertices[np.roll(triangles, 1, axis=1)]
        cell = float(np.median(np.linalg.norm(edges, axis=2)))
    shutil.copytree(HERE / "openfoam_case", folder)
    background = cell * 2**LEVEL
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    cells = np.ceil((high - low) / background).astype(int) + 2 * MARGIN
    size = cells * background
    if period:
        size[:2] = (high - low)[:2]
        cells[:2] = np.round(size[:2] / background)
    low = (low + high - size) / 2
    high = low + size
    lines = [
        "// By check_openfoam.py: the box, its cells, how fine beside the leaf, and a point in the air. Metres.",
        "".join(f"{axis}Min {value:.12g}; " for axis, value in zip("xyz", low, strict=True)),
        "".join(f"{axis}Max {value:.12g}; " for axis, value in zip("xyz", high, strict=True)),
        "".join(f"{axis}Cells {value}; " for axis, value in zip("xyz", cells, strict=True)),
        f"level {LEVEL};",
        # In the corner of the box, and on no face of a cell of any level.
        "".join(f"{axis}Inside {value - 0.37 * background:.12g}; " for axis, value in zip("xyz", high, strict=True)),
    ]
    (folder / "system" / "leafDict").write_text("\n".join(lines) + "\n")
    return cell, float(np.prod(high - low))


def prepare(mesh, folder, cell, *, period=False):
    """Write a case around a mesh; return the mesh in metres, the finest cell and the box's volume."""
    with tempfile.TemporaryDirectory() as scratch:
        written = Path(scratch) / "leaf.obj"
        o3l.export_mesh(mesh, written, consumer="openfoam")
        metres = o3l.read_mesh(written).mesh
        cell, box = write_case(metres, folder, cell, period=period)
        surface = folder / "constant" / "triSurface" / "leaf.obj"
        surface.parent.mkdir(parents=True)
        shutil.copy(written, surface)
    return metres, cell, box


def make_mesh(verdict, folder, *last):
    """Run the meshing tools and the last ones; return what the last of them printed, or None if one failed."""
    start = time.perf_counter()
    for command in (["blockMesh"], ["surfaceFeatureExtract"], ["snappyHexMesh", "-overwrite"], *last):
        text, well = run(folder, *command)
        if command[0] == "snappyHexMesh":
            clean = "Finished meshing without any errors" in text
            verdict.note("finished meshing without any errors", clean, good=clean)
        if not well:
            verdict.note("ended well", f"not {command[0]}", good=False)
            return None
    verdict.note("seconds", f"{time.perf_counter() - start:.1f}")
    made = number(r"cells: +(\d+)", text)
    verdict.note("cells", f"{made or 0:,.0f}")
    return text


def check_period(name, mesh, folder, cell):
    """Return what is made of the air above one period, its opposite sides cyclic."""
    verdict, folder = Verdict(f"cyclic air above {name}"), folder / f"period_{name}"
    prepare(mesh, folder, cell, period=True)
    if make_mesh(verdict, folder, ["createPatch", "-overwrite"], ["checkMesh", "-allGeometry"]) is None:
        return verdict
    weights = re.findall(r"sum\(weights\) min:(\S+)", (folder / "log.checkMesh").read_text())
    least = min(map(float, weights), default=0.0)
    verdict.note("pairs of sides, least weight", f"{len(weights) // 2}, {least:.3g}", good=least > WEIGHT)
    text, _ = run(folder, "checkMesh")
    verdict.note("checkMesh", "Mesh OK" if "Mesh OK." in text else "failed", good="Mesh OK." in text)
    verdict.note("patches", ", ".join(f"{patch} ({count:,} faces)" for patch, count, _ in
                 patch_points(folder / "constant" / "polyMesh")))  # fmt: skip
    return verdict


def check_case(name, mesh, folder, cell):
    """Return what snappyHexMesh makes of the air around a closed surface, and checkMesh says of it."""
    verdict, folder = Verdict(f"snappyHexMesh around {name}"), folder / f"case_{name}"
    metres, cell, box = prepare(mesh, folder, cell)
    text = make_mesh(verdict, folder, ["checkMesh"])
    if text is None:
        return verdict
    fine = "Mesh OK." in text
    verdict.note("checkMesh", "Mesh OK" if fine else re.findall(r"\*\*\*(.*)", text), good=fine)
    verdict.note("non-orthogonality, largest", number(r"non-orthogonality Max: (\S+)", text))
    verdict.note("skewness, largest", number(r"Max skewness = (\S+)", text))
    patches = patch_points(folder / "constant" / "polyMesh")
    verdict.note("patches", ", ".join(f"{patch} ({count:,} faces)" for patch, count, _ in patches), good=bool(patches))
    points = np.concatenate([np.empty((0, 3)), *(each for _, _, each in patches)])
    if len(points):
        off = distances(metres, points) / cell
        within = float(np.quantile(off, 0.99))
        verdict.note("points off the surface, cells", f"99 % within {within:.2g}, at most {off.max():.2g}",
                     good=within < ON_SURFACE)  # fmt: skip
    volume = enclosed_volume(*mesh_arrays(metres))
    error = abs(box - (number(r"Total volume = (\S+)", text) or 0) - volume) / volume
    verdict.note("volume left out, relative error", f"{error:.2g}", good=error < VOLUME)
    return verdict


def patch_points(folder):
    """Return (name, faces, points) of the leaf's patches in an ASCII polyMesh."""
    points = np.array(
        re.findall(r"^\((\S+) (\S+) (\S+)\)$", (folder / "points").read_text(), re.MULTILINE), dtype=float
    )
    faces = re.findall(r"^\d+\(([\d ]+)\)$", (folder / "faces").read_text(), re.MULTILINE)
    found = []
    for name, body in re.findall(
        r"^\s*(leaf\w*)\s*\{(.*?)\}", (folder / "boundary").read_text(), re.MULTILINE | re.DOTALL
    ):
        count, start = (int(number(rf"{word}\s+(\d+);", body)) for word in ("nFaces", "startFace"))
        corners = np.unique([int(word) for face in faces[start : start + count] for word in face.split()])
        found.append((name, count, points[corners.astype(int)]))
    return found


def distances(mesh, points):
    """Return the distances of points to a mesh, measured around its middle in single precision."""
    vertices, triangles = mesh_arrays(mesh)
    middle, size = vertices.mean(axis=0), np.ptp(vertices)
    scene = o3d.t.geometry.RaycastingScene()
    local = [o3d.core.Tensor.from_numpy(((part - middle) / size).astype(np.float32)) for part in (vertices, points)]
    scene.add_triangles(local[0], o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)))
    return scene.compute_distance(local[1]).numpy() * size


def own_meshes(options):
    """Return four tiles, the whole leaf, and one tile, all closed."""
    if options.model is None:
        names = ("wheat_scan.ply", "wheat_ct_24um.tif", "wheat_midrib.ply")
        scan, volume, midrib = (SAMPLES / name for name in names)
        read = o3d.io.read_point_cloud
        leaf = o3l.create_multiscale_leaf(read(str(scan)), o3l.read_volume(volume), read(str(midrib)))
    else:
        leaf = o3l.load(options.model)
    period = np.asarray(leaf.texture.period) / leaf.scale
    middle = leaf.blade.outline.bounds.mean(axis=0)
    region = np.array([middle - period, middle + period])

    def solid(step, region=None):
        return leaf.plan_mesh(step, region, closed=True).extract(remesh=None if options.no_remesh else step)

    return {
        "four_tiles": solid(options.tile_spacing, region),
        "leaf": solid(options.spacing),
        "tile": leaf.extract_tile(options.tile_spacing),
    }


def read(path, unit):
    """Return a mesh of a file, in the unit that it states or that was given."""
    found = o3l.read_mesh(path)
    return o3l.LabelledMesh(found.mesh, found.labels, found.names, found.unit or unit)


def check(options, folder):
    """Yield the verdicts."""
    surfaces = {f"{number}_{path.stem}": read(path, options.unit) for number, path in enumerate(options.mesh)}
    cases = {path.stem: read(path, options.unit) for path in options.snap}
    periods = {path.stem: read(path, options.unit) for path in options.period}
    if not surfaces and not cases and not periods:
        surfaces = own_meshes(options)
        periods = {"tile": surfaces["tile"]}
        cases = periods | {"four_tiles": surfaces["four_tiles"]}
    for name, mesh in surfaces.items():
        yield check_surface(name, mesh, folder, ".stl" if options.stl else ".obj")
    for name, mesh in cases.items():
        yield check_case(name, mesh, folder, options.cell)
    for name, mesh in periods.items():
        yield check_period(name, mesh, folder, options.cell)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="*", type=Path, help="closed meshes for surfaceCheck")
    parser.add_argument("--snap", action="append", default=[], type=Path, metavar="MESH", help="for snappyHexMesh")
    parser.add_argument(
        "--period", action="append", default=[], type=Path, metavar="MESH", help="a tile, for cyclic air"
    )
    parser.add_argument("--unit", help="unit of the meshes, where their files do not state it")
    parser.add_argument("--model", type=Path, help="a leaf's model (.o3l); else the samples' leaf is made")
    parser.add_argument("--spacing", type=float, default=0.1, help="mesh step of the leaf, in its unit")
    parser.add_argument("--tile-spacing", type=float, default=0.024, help="mesh step of the tiles")
    parser.add_argument("--no-remesh", action="store_true", help="leave the leaf as it was polygonised")
    parser.add_argument("--stl", action="store_true", help="give surfaceCheck STL with named solids, not OBJ")
    parser.add_argument("--cell", type=float, help="cells beside the leaf, in metres; the mesh's median edge")
    parser.add_argument("-o", "--output", type=Path, help="folder for cases and logs; a temporary one by default")
    options = parser.parse_args()
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        print(
            f"check_openfoam: {', '.join(missing)} not found; on Debian: apt-get install -y --no-install-recommends "
            "openfoam (1 GB), elsewhere: source OpenFOAM's etc/bashrc",
            file=sys.stderr,
        )
        return 2
    if options.output is not None and options.output.exists() and any(options.output.iterdir()):
        print(f"check_openfoam: {options.output} is not empty; give a new folder", file=sys.stderr)
        return 2
    wrong = False
    with tempfile.TemporaryDirectory() as scratch:
        for verdict in check(options, Path(options.output or scratch)):
            print(verdict, flush=True)
            wrong |= bool(verdict.wrong)
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
