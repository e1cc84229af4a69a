"""What the solver of a droplet case makes of a flat plate: spread at two resolutions, contact angles, static shapes.

python scripts/validate_droplet.py                        # all of it, one run after another, in /tmp or -o FOLDER
python scripts/validate_droplet.py spread --cells 0.035 0.028
python scripts/validate_droplet.py angles --angles 90 150 --cells 0.028

The plate is z = 0, the case otherwise that of `o3dleaf export --for droplet`, but for a quarter of it: the droplet
stands over a corner of the box, whose sides are mirrors. For the angles it starts at rest as a cap whose angle is 10
degrees less than the one that is set, and swings; its angle is that of the cap of the same volume and height, and the
mean is over one oscillation, from a lowest height to the next. Beside it: the height of the static drop by the equation
of Young and Laplace, integrated here. Processor time is that of the solver alone, by its own log. Cases that are in the
folder already go on to the time that is asked for.
"""

import argparse
import re
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.signal import find_peaks

from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.output.droplet.box import DropletBox
from o3dleaf.output.droplet.case import DropletCase
from o3dleaf.output.droplet.readings import DropletReadings, cap_of
from o3dleaf.output.droplet.solver import SolverRun, require_openfoam
from o3dleaf.output.droplet.surfaces import grid_solid
from o3dleaf.output.droplet.units import LENGTH, TIME, Impact

SIZE = 1.2e-3
SWING = 10.0
"""Degrees."""


def plate():
    """Return a flat solid around the box, its upper face z = 0, in meters."""
    x, y = np.meshgrid(np.linspace(-SIZE / 2, SIZE / 2, 25), np.linspace(-SIZE / 2, SIZE / 2, 25), indexing="ij")
    flat = [np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)]) for z in (0.0, -3e-4)]
    triangles, labels = grid_solid(*x.shape)
    return LabelledMesh(build_mesh(np.concatenate(flat), triangles), labels, unit="m")


def write_quarter(folder, impact, cell, duration, start=None, radius=None):
    """Write a case of a quarter of a droplet on the plate; `start` and `radius` of its ball, if it is no whole one."""
    box = DropletBox.around(np.zeros((1, 3)), impact, SIZE, cell)
    box = box if start is None else replace(box, start=start)
    if not folder.exists():
        folder.mkdir(parents=True)
        DropletCase(impact, box, duration, 2.5e-5, {"title": "plate"}).write(folder, {"plate": plate()})
    numbers = folder / "constants"
    text = numbers.read_text()
    changed = {"xMin": 0, "yMin": 0, "xCells": box.cells[0] // 2, "yCells": box.cells[1] // 2}
    changed["endTime"] = duration / TIME
    changed |= {"xMax": box.cells[0] // 2 * cell / LENGTH, "yMax": box.cells[1] // 2 * cell / LENGTH}
    if radius is not None:
        changed |= {"radius": radius / LENGTH, "zSpeed": 0}
    for name, value in changed.items():
        text = re.sub(rf"^({name}\s+)\S+;", rf"\g<1>{value:.10g};", text, flags=re.MULTILINE)
    numbers.write_text(text)
    return folder / "plate"


def solve(variant, duration):
    """Run a case on one core; return what was read, and its processor seconds."""
    run = SolverRun(variant, duration)
    if not run.finished:
        run.start(1)
        run.process.wait()
        run.require_success()
    logs = [variant / name for name in ("log.solver.before", "log.solver") if (variant / name).exists()]
    times = [float(each) for log in logs for each in re.findall(r"ExecutionTime = (\S+) s", log.read_text())]
    # Each start counts from zero.
    ends = [time for time, following in zip(times, [*times[1:], 0.0], strict=True) if following < time]
    return DropletReadings.read(variant), sum(ends)


def check_spread(folder, cells, angle):
    """Print the largest width of an impact at several cells."""
    impact, widest = Impact(angle=angle), []
    print(f"spread at {impact.speed:g} m/s, {angle:g} degrees, 1.1 ms")
    for cell in cells:
        found, seconds = solve(write_quarter(folder / f"spread_{cell:g}", impact, cell * 1e-3, 1.1e-3), 1.1e-3)
        widths = 2 * np.array([found.column("width_along").max(), found.column("width_across").max()]) / impact.diameter
        drift = np.abs(found.column("volume") / found.column("volume")[0] - 1).max()
        print(f"    cells of {cell * 1e3:g} um: {widths[0]:.4f} and {widths[1]:.4f} diameters, volume to {drift:.1e}, "
              f"alpha >= {found.column('alpha_min').min():.1e}, {seconds:.0f} s", flush=True)  # fmt: skip
        widest.append(widths.mean())
    if len(widest) > 1:
        print(f"    differ by {abs(widest[0] / widest[-1] - 1):.2%}", flush=True)


def check_angles(folder, cell, angles, duration):
    """Print the angles and heights of droplets at rest on the plate."""
    print(f"angles, cells of {cell * 1e3:g} um, {duration * 1e3:g} ms")
    for angle in angles:
        impact = Impact(angle=angle)
        volume = np.pi / 6 * impact.diameter**3
        ball = cap_radius(volume, angle - SWING)
        start = -ball * np.cos(np.radians(angle - SWING))
        variant = write_quarter(folder / f"angle_{angle:g}_{cell:g}", impact, cell * 1e-3, duration, start, ball)
        found, seconds = solve(variant, duration)
        late = one_oscillation(found.column("height"))
        volumes, heights = 4 * found.column("volume")[late], found.column("height")[late]
        seen = np.array([cap_of(*each) for each in zip(volumes, heights, strict=True)])
        height = static_height(volumes.mean(), angle, impact)
        print(f"    set {angle:g}: mean {seen.mean():.1f}, {seen.min():.1f} to {seen.max():.1f} degrees; mean height "
              f"{heights.mean() * 1e3:.4f} mm, Young-Laplace {height * 1e3:.4f} ({heights.mean() / height - 1:+.2%}); "
              f"fastest at the end {found.column('fastest')[-4:].max():.2f} m/s, "
              f"volume to {np.abs(found.column('volume') / found.column('volume')[0] - 1).max():.1e}, "
              f"alpha >= {found.column('alpha_min').min():.1e}, {seconds:.0f} s", flush=True)  # fmt: skip


def one_oscillation(height):
    """Return the rows from the first lowest height to the next, or all where there is none."""
    smooth = np.convolve(np.pad(height, 4, mode="edge"), np.ones(9) / 9, mode="valid")
    lowest = find_peaks(-smooth, distance=30)[0]
    if len(lowest) < 2:
        print("    (no whole oscillation; the mean is over all of the run)")
    return slice(lowest[0], lowest[1]) if len(lowest) > 1 else slice(None)


def cap_radius(volume, angle):
    """Return the radius of the ball of which a cap with a contact angle in degrees has a volume."""
    c = np.cos(np.radians(angle))
    return (3 * volume / (np.pi * (1 - c) ** 2 * (2 + c))) ** (1 / 3)


def static_height(volume, angle, impact):
    """Return the height of the drop at rest, by the equation of Young and Laplace in arc length from its top."""
    weight = impact.density * abs(impact.gravity[2]) / impact.tension

    def shape(top):
        def slope(_, state):
            r, z, phi, _volume = state
            bend = 2 / top + weight * z - (np.sin(phi) / r if r > 1e-12 else 1 / top)
            return [np.cos(phi), np.sin(phi), bend, np.pi * r**2 * np.sin(phi)]

        def wall(_, state):
            return state[2] - np.radians(angle)

        wall.terminal = True
        ended = solve_ivp(slope, (0, 20 * top), [0.0, 0.0, 0.0, 0.0], events=wall, rtol=1e-9, atol=1e-15)
        return ended.y[1:, -1][[0, 2]]

    guess = cap_radius(volume, angle)
    top = brentq(lambda each: shape(each)[1] - volume, 0.5 * guess, 2 * guess, xtol=1e-12)
    return float(shape(top)[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=["spread", "angles"], help="spread, angles")
    parser.add_argument("--cells", type=float, nargs="+", help="mm; 0.035 and 0.028 for spread, 0.028 for angles")
    parser.add_argument("--angles", type=float, nargs="+", default=[90.0, 120.0, 140.0, 150.0])
    parser.add_argument("--duration", type=float, default=2.6, help="of the angles, ms")
    parser.add_argument("-o", "--output", type=Path, help="folder for the cases; a temporary one by default")
    options = parser.parse_args()
    require_openfoam()
    folder = options.output or Path(mkdtemp(prefix="droplet_"))
    if "spread" in options.what:
        check_spread(folder, options.cells or [0.035, 0.028], 150.0)
    if "angles" in options.what:
        check_angles(folder, (options.cells or [0.028])[0], options.angles, options.duration * 1e-3)


if __name__ == "__main__":
    sys.exit(main())
