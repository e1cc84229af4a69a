"""Ours beside its peers: oriented clouds of surfaces that are known, clean and noisy, and real scans.

python scripts/bench_peers.py [--json FILE] [--shapes ...] [--points ...] [--noise ...] [--methods ...]
                              [--normals ...] [--quick]

Every method gets the same points and the same normals: those of the truth on a clean cloud, on a noisy one Open3D's PCA
normals (30 neighbours) turned to the truth's side. Scans keep their own normals, unless neighbours are at odds.
With --normals none ours gets no normals, and the peers Open3D's, made consistent over 30 neighbours. A shape is a solid
of o3dleaf.samples, horse or lucy, a scan, or a file of any closed mesh, which then is the truth.
The peers' lattices, octrees and first balls have the spacing of the cloud, sqrt(area / points), octrees the next finer
power of two; ours is called with nothing but the cloud and takes 0.6 to 1 of it. Each call has a process of its own;
seconds and peak_mb (resident memory beyond what was there before) are those of the call alone, after a warm-up on small
balls and a block, so that imports and compilation are not counted. Accuracy: mean distance to the truth, closest points
by formula or Newton's method, of 200,000 points of the mesh, and completeness: of as many points of the truth to the
mesh; both uniform by area. hausdorff95 and hausdorff are the larger of the two ways. fscore counts what is nearer than
the noise, or than a tenth of the spacing where there is less. Normal consistency is the mean cosine, -1 for a surface
turned inside out. Real scans have no truth: nine tenths are reconstructed from, completeness is the distance of the
others to the mesh, accuracy that of the mesh to the nearest point of the whole scan (never below a part of its
spacing), and fscore counts within one spacing.
"""

import argparse
import math
import os
import platform
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
import open3d as o3d
from clouds import MESHES, SCANS, SHARED, SOLIDS, scanned, synthetic
from measuring import number, write_json
from peers import METHODS, is_there, reconstruct
from rich.console import Console
from rich.table import Table
from surface_errors import shape_of

from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.mesh_arrays import drop_unused_vertices
from o3dleaf.core.parallel import get_num_threads

OURS = "rbfpu"
POISSONS = ("open3d_poisson", "meshlab_poisson")
JUDGED = {"accuracy": 1.0, "completeness": 1.0, "hausdorff": 1.1}
"""What is held against the best peer's, and how many times that it may be; a largest error is one point's."""
QUICK_SAMPLES = 20_000
TRIES = 3
"""Open3D's Poisson dies of its threads now and then (isl-org/Open3D, issue 6828); it gets another chance."""


@dataclass
class Record:
    """One method on one cloud; lengths in the cloud's unit, None where it failed or cannot be known."""

    shape: str
    points: int
    noise: float
    method: str
    accuracy: float | None = None
    completeness: float | None = None
    hausdorff95: float | None = None
    hausdorff: float | None = None
    normal_consistency: float | None = None
    fscore: float | None = None
    components: int | None = None
    manifold: bool | None = None
    boundary_edges: int | None = None
    seconds: float | None = None
    peak_mb: float | None = None
    processor_seconds: float | None = None
    euler: int | None = None
    true_euler: int | None = None
    spacing: float | None = None
    triangles: int | None = None
    area: float | None = None
    nonfinite_vertices: int | None = None
    crashes: int = 0
    failed: str | None = None
    oriented: bool = True


def judge(case, method, limit):
    """Return the record of a method on a case, failed or not."""
    record = Record(case.shape, len(case.points), case.noise, method, spacing=case.spacing)
    record.true_euler, record.oriented = case.euler, case.oriented
    found = attempt(case, method, limit, record)
    if found is None:
        return record
    vertices, triangles, record.seconds, record.processor_seconds, peak = found
    record.peak_mb = None if math.isnan(peak) else peak
    whole = np.isfinite(vertices).all(axis=1)
    record.nonfinite_vertices = int((~whole).sum())
    # What a viewer does with them: their triangles are not there.
    vertices, triangles = drop_unused_vertices(vertices, triangles[whole[triangles].all(axis=1)])
    if not len(triangles):
        record.failed = "found no surface"
        return record
    for name, value in (case.errors(vertices, triangles) | shape_of(vertices, triangles)).items():
        setattr(record, name, value)
    return record


def attempt(case, method, limit, record):
    """Return what `reconstruct` does, or None; the record says why, and how often the method crashed before."""
    while record.crashes < TRIES:
        record.failed = None
        try:
            return reconstruct(
                case.points, case.normals, method, case.spacing, case.is_open, limit, oriented=case.oriented
            )
        except O3DLeafError as error:
            record.failed = "timed out" if "did not end within" in str(error) else str(error)
            if "died of" not in record.failed:
                break
            record.crashes += 1
    return None


def cases(options):
    """Yield the clouds that are asked for."""
    samples = QUICK_SAMPLES if options.quick else None
    for shape in options.shapes:
        if shape in SCANS and (SHARED / SCANS[shape][0]).exists():
            yield scanned(shape, samples)
        elif shape in SCANS:
            print(f"{shape}: {SHARED / SCANS[shape][0]} is not there; left out")
        elif shape not in SOLIDS and not (SHARED / MESHES.get(shape, shape)).exists():
            print(f"{shape}: {SHARED / MESHES.get(shape, shape)} is not there; left out")
        else:
            for count in options.points:
                for noise in options.noise:
                    yield synthetic(shape, count, noise, options.normals, samples)


def table_of(records):
    """Return one row a record."""
    table = Table(title="Lengths in percent of the cloud's spacing")
    table.add_column("cloud")
    table.add_column("method")
    heads = (
        "accuracy",
        "complete",
        "95 %",
        "Hausdorff",
        "normals",
        "F",
        "pieces",
        "manifold",
        "open edges",
        "V-E+F",
        "truth",
        "s",
        "MB",
    )
    for head in heads:
        table.add_column(head, justify="right")
    for r in records:
        lengths = r.accuracy, r.completeness, r.hausdorff95, r.hausdorff
        lengths = [None if x is None else 100 * x / r.spacing for x in lengths]
        table.add_row(
            name_of(r),
            r.method,
            *([number(x) for x in lengths] if r.failed is None else [f"[red]{r.failed}", "", "", ""]),
            number(r.normal_consistency, "{:.4f}"),
            number(r.fscore, "{:.3f}"),
            number(r.components, "{}"),
            number(r.manifold, "{}"),
            number(r.boundary_edges, "{}"),
            number(r.euler, "{}"),
            number(r.true_euler, "{}"),
            number(r.seconds, "{:.2f}"),
            number(r.peak_mb, "{:.0f}"),
        )
    return table


def name_of(record):
    return f"{record.shape} {record.points:,} {record.noise:.1%}" + ("" if record.oriented else " unoriented")


def verdicts(records):
    """Return for each cloud what ours is beside its peers: {measure: (best peer, its figure, ours over it)}.

    Under "poisson" and the measure's name: ours over the better of the two Poissons; under "seconds" and
    "processor_seconds": ours over Open3D's. A ratio is None where either has no figure.
    """
    found = {}
    for name in dict.fromkeys(map(name_of, records)):
        by = {r.method: r for r in records if name_of(r) == name}
        ours, peers = by.get(OURS), [r for m, r in by.items() if m != OURS]
        found[name] = {each: against(ours, peers, each) for each in JUDGED}
        poissons = [r for r in peers if r.method in POISSONS]
        found[name] |= {f"poisson {each}": against(ours, poissons, each) for each in list(JUDGED)[:2]}
        for each in ("seconds", "processor_seconds"):
            found[name][each] = against(ours, [r for r in peers if r.method == POISSONS[0]], each)
    return found


def against(ours, peers, measure):
    """Return the peer of the least figure, that figure, lengths in percent of the spacing, and ours over it."""
    known = [r for r in peers if getattr(r, measure) is not None]
    if not known:
        return None, None, None
    best = min(known, key=lambda r: getattr(r, measure))
    figure, own = getattr(best, measure), None if ours is None else getattr(ours, measure)
    ratio = None if own is None or not figure else own / figure
    return best.method, figure if measure.endswith("seconds") else 100 * figure / best.spacing, ratio


def holds(verdict, measure):
    """Say whether ours is no worse than the best peer and, where that is asked, better than either Poisson."""
    ratio, poisson = verdict[measure][2], verdict.get(f"poisson {measure}", (None, None, None))[2]
    return ratio is not None and ratio <= JUDGED[measure] and (poisson is None or poisson < 1)


def topology_of(records):
    """Return how many closed truths there are, and of how many ours has no open edge, and pieces and V − E + F right.

    The second counts where the truth's is known and a peer has it: what no method finds, the sampling may not show.
    """
    closed = [r for r in records if r.method == OURS and r.true_euler is not None]
    found = {name_of(r) for r in records if r.method != OURS and r.euler == r.true_euler and r.components == 1}
    resolved = [r for r in closed if name_of(r) in found]
    right = sum(r.euler == r.true_euler and r.components == 1 for r in resolved)
    whole = sum(r.boundary_edges == 0 for r in closed)
    return (
        f"no open edge on {whole} of {len(closed)} closed truths; "
        f"one piece of the truth's genus on {right} of {len(resolved)} where a peer has it"
    )


def summary_of(found):
    """Return a table of the verdicts."""
    table = Table(
        title="Ours over the best peer (over the better Poisson), its figure in % of the spacing; s over Open3D's"
    )
    for head in ("cloud", *JUDGED, "s", "processor s"):
        table.add_column(head)
    for name, verdict in found.items():
        cells = []
        for measure in JUDGED:
            method, figure, ratio = verdict[measure]
            poisson = verdict.get(f"poisson {measure}", (None, None, None))[2]
            beside = "" if poisson is None else f" ({poisson:.2f})"
            peer = "no peer" if method is None else f"{method} {figure:.3g}"
            colour = "green" if holds(verdict, measure) else "red"
            cells.append(peer if ratio is None else f"[{colour}]{ratio:.2f}{beside}[/] {peer}")
        table.add_row(name, *cells, *(number(verdict[each][2], "{:.2f}") for each in ("seconds", "processor_seconds")))
    return table


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    every = [*SOLIDS, *MESHES, *SCANS]
    parser.add_argument("--shapes", nargs="+", default=None, help=f"or files of closed meshes; default: {every}")
    parser.add_argument("--points", nargs="+", type=int, default=None, help="default: 5000 40000; try 500000")
    parser.add_argument("--noise", nargs="+", type=float, default=[0.0, 0.002, 0.005], help="of the box's diagonal")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--normals", choices=["auto", "truth", "estimated", "none"], default="auto")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds that a method may take")
    parser.add_argument("--json", metavar="FILE", help="write the records there, after each of them")
    parser.add_argument("--quick", action="store_true", help="5,000 points, fewer samples, solids only")
    options = parser.parse_args(arguments)
    options.shapes = options.shapes or (list(SOLIDS) if options.quick else every)
    options.points = options.points or ([5000] if options.quick else [5000, 40_000])
    return options


def main(arguments=None):
    options = parse(arguments)
    machine = f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores"
    load = f", load {os.getloadavg()[0]:.1f} before the start" if hasattr(os, "getloadavg") else ""  # not on Windows
    print(f"{machine}, {get_num_threads()} threads of ours{load};")
    print(f"Open3D {o3d.__version__}, pymeshlab {version('pymeshlab')}, Python {platform.python_version()}")
    methods = [each for each in options.methods if is_there(each)]
    for missing in set(options.methods) - set(methods):
        print(f"{missing}: not in this version of o3dleaf; left out")
    records = []
    for case in cases(options):
        for method in methods:
            records.append(judge(case, method, options.limit))
            r = records[-1]
            said = r.failed or f"accuracy {r.accuracy:.3g}, {r.seconds:.2f} s"
            said += f", after {r.crashes} crashes" if r.crashes else ""
            print(f"{name_of(r)}, {method}: {said}", flush=True)
            if options.json:
                write_json(options.json, records)
    console = Console(width=180 if not os.isatty(1) else None)
    console.print(table_of(records))
    found = verdicts(records)
    console.print(summary_of(found))
    if OURS in methods:
        for measure in JUDGED:
            print(f"{measure}: holds on {sum(holds(each, measure) for each in found.values())} of {len(found)} clouds")
        print(topology_of(records))
    return records


if __name__ == "__main__":
    main()
