"""The engine beside its peers on the same data: fit, 1.9 million evaluations, error against the truth, memory.

python scripts/bench_engine.py [--json FILE] [--quick] [--patient]

Peers: SciPy's RBFInterpolator, global (where n² numbers fit into memory) and with 50 neighbours; and
ferreus_rbf (the `bench` extra), a fast multipole solver, to its default relative tolerance of 1e-6.
All interpolate the same noisy values without smoothing, r³ with a tail of degree 2 (in the plane 1);
ours is shown with a smoothing chosen by "gcv" as well. An asterisk marks a time that was extrapolated
from a part. Not counted: imports and compilation, which the last line is about.
"""

import argparse
import importlib.util
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
from measuring import Row, measure, show, write_json
from scipy.interpolate import RBFInterpolator

import o3dleaf as o3l
from o3dleaf.core.parallel import get_num_threads, set_num_threads

EVALUATIONS = 1_900_000
MAX_GLOBAL = 7000
"""Points that SciPy's global system is asked to hold: 0.4 GB a matrix."""
FERREUS = importlib.util.find_spec("ferreus_rbf") is not None

START_UP = """
import time, numpy as np, o3dleaf as o3l
o3l.PUInterpolant
start = time.perf_counter()
points = np.random.default_rng(0).random((2000, 3))
o3l.PUInterpolant.fit(points, points[:, 0])(points[:10])
print(time.perf_counter() - start)
"""


@dataclass
class Case:
    """Noisy values of a known truth."""

    name: str
    points: np.ndarray
    values: np.ndarray
    queries: np.ndarray
    at: np.ndarray
    clean: np.ndarray
    degree: int

    def error(self, field):
        return float(np.sqrt(np.mean((field(self.at) - self.clean) ** 2)))


def height_case(count, queries, rng):
    """Heights of a synthetic blade, 0.1 mm of noise, in the plane."""
    truth = o3l.samples.wheat_scan(count=500).truth
    along = rng.uniform(0.05, 0.95, count + queries) * truth.length
    across = rng.uniform(-0.9, 0.9, count + queries) * truth.half_width(along)
    plane, heights = np.column_stack([along, across]), truth.height(along, across)
    noisy = heights[:count] + rng.normal(0, 0.1, count)
    some = slice(count, count + 5000)
    return Case(f"{count:,} heights", plane[:count], noisy, plane[count:], plane[some], heights[some], 1)


def voxel_case(queries, rng, **options):
    """The synthetic micro-CT sample at 24 micrometres, intensity less the surface's."""
    volume, truth = o3l.samples.wheat_ct(drift=0.0, **options)
    level = volume.threshold()
    points, values = volume.to_samples(level)
    where = rng.uniform(points.min(axis=0), points.max(axis=0), (queries, 3))
    at = points[rng.choice(len(points), 5000, replace=False)]
    return Case(f"{len(points):,} voxels", points, values, where, at, truth(at) - level, 2)


def scattered_case(count, queries, rng):
    """Waves of unit size on scattered points, 0.05 of noise."""

    def truth(x):
        return np.sin(9 * x[:, 0]) + np.cos(7 * x[:, 1] + x[:, 2]) * np.sin(8 * x[:, 2])

    points, where = rng.random((count, 3)), rng.uniform(0.02, 0.98, (queries, 3))
    values = truth(points) + rng.normal(0, 0.05, count)
    return Case(f"{count:,} scattered", points, values, where, where[:5000], truth(where[:5000]), 2)


def ours(case, **options):
    return o3l.PUInterpolant.fit(case.points, case.values, degree=case.degree, **options)


def compare(case, patient):
    """Return the rows of one case."""
    field = ours(case)
    field(case.queries[:1000])
    field, fit_seconds, fit_peak = measure(lambda: ours(case), 2)
    _, seconds, peak = measure(lambda: field(case.queries), 2)
    error = case.error(field)
    fit = {"seconds": fit_seconds, "rms_error": error, "peak_mb": fit_peak}
    call = {"seconds": seconds, "rms_error": error, "peak_mb": peak}
    smooth, smooth_seconds, smooth_peak = measure(lambda: ours(case, smoothing="gcv"))
    scale, queries = case.name, f"{len(case.queries):,} points"
    rows = [Row("fit, smoothing by gcv", scale, smooth_seconds, rms_error=case.error(smooth), peak_mb=smooth_peak)]
    if len(case.points) <= MAX_GLOBAL:
        rows += peer_rows(case, "SciPy, global", lambda: scipy_fit(case, None), fit, call, 20_000)
    else:
        rows.append(Row("fit", scale, **fit, peer=f"SciPy, global: not run, {len(case.points) ** 2 * 8 / 1e9:.0f} GB"))
    rows += peer_rows(case, "SciPy, 50 neighbours", lambda: scipy_fit(case, 50), fit, call, 5_000)
    if not FERREUS:
        rows.append(Row("fit", scale, **fit, peer="ferreus_rbf: not installed"))
    elif len(case.points) > 200_000 and not patient:
        rows.append(Row("fit", scale, **fit, peer="ferreus_rbf: not run, see --patient"))
    else:
        rows += peer_rows(case, "ferreus_rbf", lambda: ferreus_fit(case), fit, call, None)
    for row in rows[1:]:
        if row.operation == "evaluate":
            row.scale = f"{queries} of {scale}"
    return rows


def peer_rows(case, name, fit, our_fit, our_call, part):
    """Return a peer's fit and evaluation beside ours; `part` of the queries where all would take too long."""
    field, fit_seconds, _ = measure(fit)
    some = case.queries if part is None else case.queries[:part]
    _, seconds, _ = measure(lambda: field(some))
    error = case.error(field)
    rows = [
        Row("fit", case.name, **our_fit, peer=name, peer_seconds=fit_seconds, other_rms_error=error),
        Row("evaluate", case.name, **our_call, peer=name, other_rms_error=error),
    ]
    rows[1].peer_seconds = seconds * len(case.queries) / len(some)
    rows[1].ratio = rows[1].peer_seconds / rows[1].seconds
    if len(some) < len(case.queries):
        rows[1].extrapolated_from = f"{len(some):,} points"
    return rows


def scipy_fit(case, neighbors):
    return RBFInterpolator(case.points, case.values, neighbors=neighbors, kernel="cubic", degree=case.degree)


def ferreus_fit(case):
    from ferreus_rbf import RBFInterpolator as Ferreus  # noqa: PLC0415 - an extra
    from ferreus_rbf.interpolant_config import Drift, InterpolantSettings, RBFKernelType  # noqa: PLC0415

    drift = Drift.Quadratic if case.degree == 2 else Drift.Linear
    model = Ferreus(case.points, case.values, InterpolantSettings(RBFKernelType.Cubic, drift=drift))

    def field(queries):
        return np.asarray(model.evaluate(np.ascontiguousarray(queries))).reshape(len(queries))

    return field


def scaling(sizes, rng):
    """Return rows of fits of rising size; print the memory kept for a point, and the slope of log time on log N."""
    rows = []
    for count in sizes:
        case = scattered_case(count, 5000, rng)
        ours(case)
        field, seconds, peak = measure(lambda case=case: ours(case), 3)
        rows.append(Row("fit", case.name, seconds, rms_error=case.error(field), peak_mb=peak))
        numbers = field.local.weights.nbytes + field.local.sites.nbytes + field.cover.members.nbytes
        print(f"{count:>9,} points: {seconds:.3f} s, {numbers / count:.0f} bytes a point kept")
    slope = np.polyfit(np.log(sizes), np.log([row.seconds for row in rows]), 1)[0]
    print(f"slope of log time over log N: {slope:.3f}")
    return rows


def rates(case):
    """Return rows of evaluations on 1, 2, ... threads; print r³ kernels a second, and what float32 costs."""
    field = ours(case)
    sample = case.queries[:50_000]
    offsets, _ = field.index.members(sample)
    kernels = float(np.diff(offsets) @ field.cover.counts[field.index.balls]) / len(sample) * len(case.queries)
    rows, most = [], get_num_threads()
    for threads in sorted({1, 2, most}):
        set_num_threads(threads)
        for dtype in ("float64", "float32"):
            field(sample, dtype=dtype)
            _, seconds, peak = measure(lambda dtype=dtype: field(case.queries, dtype=dtype), 3)
            rows.append(Row(f"evaluate, {threads} threads, {dtype}", case.name, seconds, peak_mb=peak))
            print(f"{threads} threads, {dtype}: {kernels / seconds / 1e9:.2f} billion kernels a second")
    set_num_threads(most)
    exact = field(sample)
    off = np.abs(field(sample, dtype="float32") - exact) / exact.std()
    print(
        f"float32 against float64, of the field's spread: {np.sqrt(np.mean(off**2)):.1g} rms, {off.max():.1g} at worst"
    )
    return rows


def start_up(repeats):
    """Return the row of a second process, least of `repeats`: from the end of its imports to its first values."""
    command = [sys.executable, "-c", START_UP]
    seconds = [
        float(subprocess.run(command, check=True, capture_output=True, text=True).stdout) for _ in range(1 + repeats)
    ]
    print(f"second process, from the end of its imports to its first values: {min(seconds[1:]):.2f} s")
    return Row("first fit and values in a second process", "2,000 points", min(seconds[1:]))


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write the rows there as well")
    parser.add_argument("--quick", action="store_true", help="small scales, to see that it runs")
    parser.add_argument("--patient", action="store_true", help="ask ferreus_rbf for a million points too")
    options = parser.parse_args(arguments)
    if not FERREUS:
        print("ferreus_rbf is not installed (pip install 'o3dleaf[bench]'): its rows are left empty")
    rng, quick = np.random.default_rng(0), options.quick
    queries = 5_000 if quick else EVALUATIONS
    small = {"size": (600.0, 600.0, 480.0)} if quick else {}
    voxels = voxel_case(queries, rng, **small)
    cases = [height_case(1000 if quick else 6300, queries, rng), voxels]
    cases.append(scattered_case(6_000 if quick else 1_000_000, queries, rng))
    rows = [row for case in cases for row in compare(case, options.patient)]
    rows += rates(voxels)
    rows += scaling([1000, 2000] if quick else [10_000, 30_000, 100_000, 300_000, 1_000_000], rng)
    rows.append(start_up(1 if quick else 2))
    show("PUInterpolant beside its peers", rows, "peer")
    if options.json:
        write_json(options.json, rows)
    return rows


if __name__ == "__main__":
    main()
