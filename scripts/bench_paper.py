"""The paper's timing table, row by row: as published, as a literal baseline takes here, as o3dleaf takes here.

python scripts/bench_paper.py [--json FILE] [--quick]

Ours and the baseline run side by side on the same synthetic data, whose noise-free truth the errors
are measured against. Compilation (once, then cached on disk) is done before and is not counted, nor
is reading files. A baseline time with an asterisk was run on a part and is extrapolated linearly.
"""

import argparse

import baselines
import numpy as np
import whole_leaf
from bench_field import rate_rows, spread
from measuring import Row, measure, show, write_json

import o3dleaf as o3l
from o3dleaf.surface.isosurface.polygonize import polygonize

PCA_RADIUS = 8.0
"""In millimetres: more than half the leaf's width, so that a hole in the scan leaves points enough."""


def micro_rows(quick, rng):
    """Fit and evaluate the implicit interpolant of the voxels."""
    small = {"spacing": 40.0, "size": (600.0, 600.0, 480.0)} if quick else {}
    volume, truth = o3l.samples.wheat_ct(drift=0.0, **small)
    level = volume.threshold()
    points, values = volume.to_samples(level)
    at = rng.choice(len(points), min(5000, len(points)), replace=False)
    clean = truth(points[at]) - level
    queries = rng.uniform(points.min(axis=0), points.max(axis=0), (20_000 if quick else 1_900_000, 3))
    part = queries[: 2_000 if quick else 40_000]

    def error(field):
        return rms(field(points[at]) - clean)

    literal, literal_seconds, _ = measure(lambda: baselines.fit_micro(points, values, 5 if quick else 7))
    literal_error = error(literal)
    _, literal_evaluation, _ = measure(lambda: literal(part))
    rows = []
    lattice = {"spacing": volume.spacing, "origin": volume.origin, "isovalue": level}
    fits = {
        "fit micro interpolant": lambda: o3l.PUInterpolant.fit(points, values, rho=3e-5),
        "fit micro interpolant, rho by GCV": lambda: o3l.PUInterpolant.fit(points, values, rho="gcv"),
        "fit micro interpolant, voxel lattice": lambda: o3l.PUInterpolant.fit_lattice(volume.data, rho=3e-5, **lattice),
    }
    scale = f"{len(points):,} points"
    for name, fit in fits.items():
        fit()
        field, seconds, peak = measure(fit, 3)
        found = error(field)
        rows.append(Row(name, scale, seconds, 16.0, literal_seconds, rms_error=found, peak_mb=peak))
        rows[-1].other_rms_error = literal_error
    field = fits["fit micro interpolant"]()
    field(part)
    _, seconds, peak = measure(lambda: field(queries), 3)
    rows.append(
        Row(
            "evaluate the implicit function",
            f"{len(queries):,} points",
            seconds,
            180.0,
            literal_evaluation * len(queries) / len(part),
            rms_error=error(field),
            peak_mb=peak,
            other_rms_error=literal_error,
            extrapolated_from=f"{len(part):,} points",
        )
    )
    return rows


def frame_rows(sample, scan):
    """Return the rows of the leaf frame, the frame, and the scan in leaf coordinates."""
    midrib = np.asarray(sample.midrib)
    frame, seconds, peak = warm(lambda: o3l.LeafFrame.fit(scan, midrib, unit="mm"))
    literal, literal_seconds, _ = measure(lambda: baselines.Frame(scan, midrib, PCA_RADIUS))
    fit = Row("fit leaf frame", f"{len(midrib)} control points", seconds, 6e-3, literal_seconds, peak_mb=peak)

    leaf, seconds, peak = warm(lambda: frame.to_leaf(scan))
    literal_leaf, literal_seconds, _ = measure(lambda: literal.to_leaf(scan))
    inner = (literal_leaf[:, 0] > 0) & (literal_leaf[:, 0] < literal.end)
    there = Row("world to leaf", f"{len(scan):,} points", seconds, 1.0, literal_seconds, peak_mb=peak)
    there.rms_error = rms(frame.to_world(leaf)[inner] - scan[inner])
    there.other_rms_error = rms(literal.to_world(literal_leaf)[inner] - scan[inner])
    return [fit, there], frame, leaf, literal


def height_rows(sample, frame, leaf, count, rng):
    """Fit the height map, and sample it at `count` points."""
    along, share = np.meshgrid(np.linspace(0.1, 0.9, 200) * sample.truth.length, np.linspace(-0.7, 0.7, 15))
    across = share.ravel() * sample.truth.half_width(along.ravel())
    clean = frame.to_leaf(sample.truth.surface(along.ravel(), across))
    plane, heights = np.ascontiguousarray(leaf[:, :2]), leaf[:, 2]
    literal, literal_seconds, _ = measure(lambda: baselines.fit_height(plane, heights))
    settings = {"kernel": "thin_plate_spline", "degree": 1, "rho": baselines.RHO_HEIGHT}
    fits = {
        "fit height map": lambda: o3l.PUInterpolant.fit(plane, heights, **settings),
        "fit height map, robust, smoothing chosen": lambda: o3l.HeightMap.fit(leaf, unit="mm"),
    }
    rows = []
    for name, fit in fits.items():
        height, seconds, peak = warm(fit)
        rows.append(Row(name, f"{len(leaf):,} points", seconds, 5.5, literal_seconds, peak_mb=peak))
        rows[-1].rms_error = rms(height(clean[:, :2]) - clean[:, 2])
        rows[-1].other_rms_error = rms(literal(clean[:, :2]) - clean[:, 2])

    some = plane[rng.integers(0, len(plane), count)]
    few = some[: max(count // 180, 5000)]
    height(few)
    _, seconds, peak = measure(lambda: height(some))
    _, literal_seconds, _ = measure(lambda: literal(few))
    row = Row("sample the height map", f"{count:,} points", seconds, 720.0, literal_seconds * count / len(few))
    row.rms_error, row.other_rms_error, row.peak_mb = rows[-1].rms_error, rows[-1].other_rms_error, peak
    row.extrapolated_from = f"{len(few):,} points"
    return [*rows, row]


def world_row(frame, literal, leaf, count, rng):
    """Take `count` points of the blade's plane to the world."""
    flat = np.column_stack([leaf[rng.integers(0, len(leaf), count), :2], np.zeros(count)])
    part = flat[: count // 10]
    frame.to_world(part)
    _, seconds, peak = measure(lambda: frame.to_world(flat))
    _, literal_seconds, _ = measure(lambda: literal.to_world(part))
    row = Row("leaf to world", f"{count:,} points", seconds, 71.0, 10 * literal_seconds, peak_mb=peak)
    row.extrapolated_from = f"{len(part):,} points"
    return row


def outline_row(leaf, count, rng):
    """Ask `count` points whether they are in the outline, of the same α for both."""
    plane = np.ascontiguousarray(leaf[:, :2])
    outline = o3l.AlphaShape(plane)
    literal = baselines.AlphaShape(plane, outline.alpha)
    wanted = rng.uniform(plane.min(axis=0), plane.max(axis=0), (count, 2))
    part = wanted[: count // 10]
    outline.contains(part)
    inside, seconds, peak = measure(lambda: outline.contains(wanted))
    theirs, literal_seconds, _ = measure(lambda: literal.contains(part))
    row = Row("alpha-shape membership", f"{count:,} points", seconds, 900.0, 10 * literal_seconds, peak_mb=peak)
    differ = np.mean(inside[: len(part)] != theirs)
    row.extrapolated_from = f"{len(part):,} points, on a share of {differ:.2g} of which the two disagree (filled gaps)"
    return row


def mesh_row(quick):
    """Marching tetrahedra over a sphere, whose vertices' distances to it are known."""
    cells, few = (40, 20) if quick else (279, 60)

    def ball(n):
        axis = np.linspace(-1, 1, n + 1)
        return 0.7 - np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)

    def error(vertices, n):
        return rms(np.linalg.norm(vertices * (2 / n) - 1, axis=1) - 0.7)

    samples = ball(cells)
    polygonize(ball(few), 0.0, "tetrahedra")
    (vertices, _), seconds, peak = measure(lambda: polygonize(samples, 0.0, "tetrahedra"))
    triangles, literal_seconds, _ = measure(lambda: baselines.marching_tetrahedra(ball(few)))
    return Row(
        "marching tetrahedra",
        f"{6 * cells**3:,} tetrahedra",
        seconds,
        390.0,
        literal_seconds * cells**3 / few**3,
        rms_error=error(vertices, cells),
        peak_mb=peak,
        other_rms_error=error(triangles.reshape(-1, 3), few),
        extrapolated_from=f"{6 * few**3:,} tetrahedra, whose lattice is coarser by {cells / few:.1f}",
    )


def seam_row(quick):
    """Tile a patch of five and a half ridges plainly, and by the period whose faces match best."""
    volume, _ = o3l.samples.wheat_ct(ridges=5.5, seed=1, spacing=48.0 if quick else 24.0)
    plain = o3l.create_texture(volume)
    best, seconds, peak = warm(lambda: o3l.TiledField(plain.field, "best"), 1 if quick else 3)
    share = best.seam_energy().total / plain.seam_energy().total
    print(f"seam energy of the best period, over the plain tiling's: {share:.3f}")
    return Row("search of the best period", f"{len(plain.field.cover.radii):,} balls", seconds, peak_mb=peak)


def warm(call, repeats=3):
    """Measure a call that was made once before."""
    call()
    return measure(call, repeats)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write the rows there as well")
    parser.add_argument("--quick", action="store_true", help="small scales, to see that it runs")
    options = parser.parse_args(arguments)
    rng = np.random.default_rng(0)
    heights, members = (50_000, 200_000) if options.quick else (8_900_000, 25_000_000)
    sample = o3l.samples.wheat_scan(count=800 if options.quick else 6300)
    rows = micro_rows(options.quick, rng)
    frames, frame, leaf, literal = frame_rows(sample, np.asarray(sample.cloud.points))
    rows += frames + height_rows(sample, frame, leaf, heights, rng)
    rows += [world_row(frame, literal, leaf, heights, rng), outline_row(leaf, members, rng), mesh_row(options.quick)]
    whole, leaf = whole_leaf.rows(options.quick)
    rows += whole + rate_rows(leaf, spread(leaf, 2_000 if options.quick else 1_000_000, rng))
    rows.append(seam_row(options.quick))
    show("The paper's table (Whebell et al., Ryzen 2700, 8 cores, Julia)", rows, "baseline")
    print(
        "Not in the table: the whole run polygonises one tile, so that it needs neither 25 M membership tests nor\n"
        "130 M tetrahedra. Errors: micro in units of intensity, macro in mm. MB of the written leaves: of the process."
    )
    if options.json:
        write_json(options.json, rows)
    return rows


if __name__ == "__main__":
    main()
