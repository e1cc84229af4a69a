"""Leaves of known shape, scanned in many ways, and what a blade makes of them; real scans beside them.

python scripts/bench_leaves.py [--frame paper|surface|both] [--build MODULE:FUNCTION] [--kinds ...]
    [--conditions ...] [--seeds N] [--held-out] [--real FOLDER ...] [--closed] [--json FILE] [--quick]

Each blade is meshed at one spacing of its scan and at a quarter of it. Of both: area within 1 % (2 % where
a tenth is hidden), 99 % of mesh and truth within 0.6 spacings and two deviations of the noise of each other,
99 % of the margins within one spacing, one component, the true number of holes, no self-intersection. What
gaps hide is left out of truth to mesh and of the margins; holes as wide as gaps are asked to be filled, where
there are gaps, and margins completed, where one is hidden. The seconds are those of the blade alone; what is
compiled or loaded in a first run is not counted. A refusal fails every requirement.
"""

import argparse
import importlib
import json
import platform
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import open3d as o3d
from leaf_cases import CONDITIONS, KINDS, cases
from leaf_errors import REQUIREMENTS, Truth, judge_scan, spacing_of
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core.atomic_files import whole_file
from o3dleaf.core.errors import O3DLeafError

STEPS = (1.0, 0.25)
"""Steps of the meshes, in spacings."""
ENDINGS = {".ply", ".pcd", ".xyz", ".xyzn", ".pts"}
LARGEST = 100_000
"""Points of a real scan beyond which it is passed over, and said so."""
CLOSED_STEP = 0.1
"""Step of closed multi-scale leaves, in millimeters."""
QUICK = ["winding", "eaten"]


def builders(frames):
    """Return callables (cloud, **options of its frame) -> blade by name, one a frame."""
    return {frame: partial(build, frame=frame) for frame in frames}


def build(points, unit="mm", frame="surface", **asked):
    """Return the blade of (n, 3) points; the paper's has no holes to fill, nor a margin to complete."""
    asked = asked if frame == "surface" else {}
    return o3l.create_blade(points, unit=unit, options=o3l.BladeOptions(frame=frame, **asked))


def warm_up(make):
    """Build and judge a small leaf once, so that what is compiled or loaded is not counted."""
    run_case(make, cases(["twisted"], ["clean"], 1)[0], "")


def run_case(make, case, name):
    """Return the record of one case: judgements by step, seconds, or the refusal."""
    scan = case.scan()
    record = {
        "frame": name,
        "kind": case.name,
        "condition": case.condition,
        "seed": case.seed,
        "points": len(scan.points),
        "spacing": scan.spacing,
        "hidden": scan.hidden_share,
        "meshes": [],
        "refusal": None,
    }
    start = time.perf_counter()
    try:
        blade = make(scan.points, **case.asked)
        record["seconds"] = time.perf_counter() - start
    except Exception as cause:  # noqa: BLE001 - a fault in one leaf is a result, too
        return record | {"seconds": time.perf_counter() - start, "refusal": reason(cause)}
    truth = Truth(scan)
    for step in STEPS:
        try:
            mesh = blade.extract_mesh(step * scan.spacing)
        except Exception as cause:  # noqa: BLE001 - as above
            record["refusal"] = f"at {step:g} spacings, {reason(cause)}"
            continue
        record["meshes"].append(truth.judge(mesh, step).as_dict())
    return record


def reason(cause):
    """Return what an error says; one that is none of ours is a fault."""
    return f"{'' if isinstance(cause, O3DLeafError) else 'fault, '}{type(cause).__name__}: {cause}"


def holding(record):
    """Return (requirements that hold, all) of a record."""
    held = sum(sum(mesh["holds"].values()) for mesh in record["meshes"])
    return held, len(REQUIREMENTS) * len(STEPS)


def show(records, console):
    """Print a table of the records; shares and counts are the worse of the two meshes."""
    table = Table(title="Blades of leaves of known shape (worst of both steps; area at a spacing and at a quarter)")
    heads = ("frame", "leaf", "condition", "points", "area %", "¼ %", "to truth", "to mesh", "rim", "to rim")
    for name in (*heads, "parts", "holes", "crossings", "s", "holds"):
        table.add_column(name, justify="left" if name in ("frame", "leaf", "condition") else "right")
    for record in records:
        held, number = holding(record)
        first = (record["frame"], record["kind"], record["condition"], f"{record['points']:,}")
        meshes = record["meshes"]
        figures = ["-"] * 9
        if meshes:
            area = {mesh["step"]: f"{100 * mesh['area']:+.1f}" for mesh in meshes}
            areas = [area.get(step, "-") for step in STEPS]
            keys = ("there", "back", "margin_there", "margin_back")
            shares = [f"{100 * min(mesh[key] for mesh in meshes):.1f}" for key in keys]
            counts = [str(max(mesh[key] for mesh in meshes)) for key in ("components", "holes", "self_intersections")]
            counts[1] += f"/{meshes[0]['true_holes']}"
            figures = areas + shares + counts
        table.add_row(*first, *figures, f"{record['seconds']:.1f}", f"{held}/{number}")
    console.print(table)
    for record in records:
        if record["refusal"]:
            said = f"{record['frame']} {record['kind']}, {record['condition']}: {record['refusal']}"
            console.print(said, markup=False, highlight=False, soft_wrap=True)


def summary(records):
    """Return one line for each requirement and one for all: how many hold."""
    lines, total = [], [0, 0]
    for name in REQUIREMENTS:
        held = sum(mesh["holds"][name] for record in records for mesh in record["meshes"])
        number = len(STEPS) * len(records)
        lines.append(f"  {name}: {held} of {number}")
        total = [total[0] + held, total[1] + number]
    whole = sum(holding(record)[0] == holding(record)[1] for record in records)
    refused = sum(record["refusal"] is not None for record in records)
    lines.append(
        f"{total[0]} of {total[1]} requirements hold; all of them on {whole} of {len(records)} scans; {refused} refused"
    )
    return lines


def run_real(make, folders, name, console):
    """Return the records of the real scans under folders, printed as they come."""
    files = [p for folder in folders for p in sorted(Path(folder).rglob("*")) if p.suffix.lower() in ENDINGS]
    records = []
    for path in (p for p in files if "midrib" not in p.stem):
        record = {"frame": name, "file": f"{path.parent.name}/{path.name}", "refusal": None}
        start = time.perf_counter()
        try:
            points = np.asarray(o3l.read_point_cloud(path).points)
            record["points"] = len(points)
            if len(points) > LARGEST:
                record["refusal"] = f"passed over, more than {LARGEST:,} points"
            else:
                blade = make(points, unit="m" if np.ptp(points, axis=0).max() < 1 else "mm")
                record["seconds"] = time.perf_counter() - start
                record |= judge_scan(blade.extract_mesh(spacing_of(points)), points)
        except Exception as cause:  # noqa: BLE001 - as above
            record["refusal"] = reason(cause)
        record.setdefault("seconds", time.perf_counter() - start)
        said = record["refusal"] or ", ".join(f"{key} {record[key]:.4g}" for key in REAL_FIGURES)
        line = f"{name} {record['file']}: {record.get('points', 0):,} points, {record['seconds']:.1f} s, {said}"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
        records.append(record)
    return records


REAL_FIGURES = ("recall", "precision", "area", "components", "holes", "self_intersections")


def run_closed(make, some, name, console):
    """Return the records of closed multi-scale leaves with a small synthetic texture, printed as they come."""
    volume, _ = o3l.samples.wheat_ct(spacing=48.0, size=(960.0, 960.0, 480.0))
    texture = o3l.create_texture(volume)
    records = []
    for case in some:
        record = {"frame": name, "kind": case.name, "refusal": None}
        start = time.perf_counter()
        try:
            leaf = multiscale(make(case.scan().points), texture)
            report = o3l.mesh_report(leaf.extract_mesh(CLOSED_STEP, closed=True))
            keys = (
                "triangles",
                "watertight",
                "components",
                "self_intersections",
                "nonmanifold_edges",
                "boundary_edges",
            )
            record |= {key: getattr(report, key) for key in keys}
            said = ", ".join(f"{key} {record[key]}" for key in keys)
        except Exception as cause:  # noqa: BLE001 - as above
            said = record["refusal"] = reason(cause)
        record["seconds"] = time.perf_counter() - start
        line = f"{name} {case.name}, closed at {CLOSED_STEP} mm: {record['seconds']:.1f} s, {said}"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
        records.append(record)
    return records


def multiscale(blade, texture):
    """Return the multi-scale leaf of a blade and a texture."""
    return o3l.MultiscaleLeaf(texture, blade=blade)


def chosen(options):
    """Return the cases and the callables that the options ask for."""
    kinds = options.kinds or (QUICK if options.quick else list(KINDS))
    conditions = options.conditions or (["noise 0.2"] if options.quick else list(CONDITIONS))
    if options.build:
        module, function = options.build.split(":")
        own = getattr(importlib.import_module(module), function)
        makers = {options.build: lambda points, **_: own(points)}
    else:
        makers = builders(["paper", "surface"] if options.frame == "both" else [options.frame])
    return cases(kinds, conditions, options.seeds, held_out=options.held_out), makers


def parse(arguments):
    """Return the options."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frame", choices=("paper", "surface", "both"), default="surface")
    parser.add_argument("--build", metavar="MODULE:FUNCTION", help="a callable (n, 3) points -> blade to judge instead")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS))
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS))
    parser.add_argument("--seeds", type=int, default=1, help="scans of each leaf in each condition")
    parser.add_argument("--held-out", action="store_true", help="other leaves and seeds, to be run once, at the end")
    parser.add_argument("--real", metavar="FOLDER", nargs="+", help="the real scans under folders as well")
    parser.add_argument("--closed", action="store_true", help="closed multi-scale leaves of the clean scans, only")
    parser.add_argument("--json", metavar="FILE", help="write the records there as well")
    parser.add_argument("--quick", action="store_true", help="two leaves, one condition, to see that it runs")
    return parser.parse_args(arguments)


def main(arguments=None):
    options = parse(arguments)
    some, makers = chosen(options)
    console = Console(width=180)
    said = f"o3dleaf {o3l.__version__}, Open3D {o3d.__version__}, NumPy {np.__version__}, Python"
    machine = f"{platform.machine()}, {o3l.get_num_threads()} threads"
    console.print(f"{said} {platform.python_version()}, {platform.system()} {machine}", highlight=False)
    written = {"leaves": [], "real": [], "closed": []}
    for name, make in makers.items():
        if options.closed:
            clean = [case for case in some if case.condition == "clean"] or some
            written["closed"] += run_closed(make, clean, name, console)
            continue
        warm_up(make)
        records = []
        for case in some:
            records.append(run_case(make, case, name))
            write(written | {"leaves": written["leaves"] + records}, options.json)
            held, number = holding(records[-1])
            said = f"{len(records)} of {len(some)}: {name} {case.name}, {case.condition}: {held} of {number}"
            print(said, file=sys.stderr, flush=True)
        show(records, console)
        console.print("\n".join([f"{name}:", *summary(records)]), highlight=False)
        written["leaves"] += records
        if options.real:
            written["real"] += run_real(make, options.real, name, console)
    write(written, options.json)
    return written


def write(written, path):
    """Write all records so far, if there is a path: a long run that is stopped keeps what it has."""
    if path:
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(written, indent=1) + "\n")


if __name__ == "__main__":
    main()
