"""A droplet of SPH particles on the leaf, with pySPlisHSPlasH and without a screen; no particle goes through.

    python scripts/sph_droplet.py prepare leaf.o3l case --at 89.35 0.14     # boundary, droplet, scene
    python scripts/sph_droplet.py run case                                  # with the Python that has pySPlisHSPlasH
    python scripts/sph_droplet.py check leaf.o3l case                       # distances to the leaf's own field

Lengths are millimeters and times milliseconds, so that single precision has numbers near 1. Where the wheel of
pySPlisHSPlasH ends in libGLdispatch when it is loaded, run with LD_PRELOAD=libGLdispatch.so.0 (Debian: libglvnd0).
"""

import argparse
import json
from pathlib import Path

import numpy as np

STEP = 0.02
"""Millimeters between particles, of leaf and droplet."""
RADIUS, SPEED, ABOVE = 0.2, 0.5, 0.05
"""Of the droplet, in millimeters; meters a second, downwards; room under it at the start."""
WINDOW = 0.9
GRAVITY = 9.81e-3
"""mm/ms²."""


def prepare(model: Path, folder: Path, at: tuple[float, float]) -> None:
    """Write the leaf's boundary, the droplet, and the scene."""
    import open3d as o3d  # noqa: PLC0415  the two programs live in two environments

    import o3dleaf as o3l  # noqa: PLC0415  the two programs live in two environments
    from o3dleaf.output.export.selection import moved  # noqa: PLC0415  the two programs live in two environments

    folder.mkdir(exist_ok=True)
    leaf = o3l.load(model)
    along, across = at
    half = WINDOW / 2
    region = [[along - half, across - half], [along + half, across + half]]
    solid = leaf.plan_mesh(STEP, region, closed=True).extract()
    boundary = o3l.sample_boundary(solid, STEP, layers=3, field=leaf)
    near = np.linalg.norm(leaf.blade.flatten(boundary.points)[:, :2] - at, axis=1) < RADIUS
    origin = leaf.blade.lift([[along, across, 0.0]])[0]
    boundary = o3l.Particles(
        boundary.points - origin, boundary.normals, boundary.sizes, boundary.labels, "mm", boundary.layers
    )
    top = boundary.points[near, 2].max()
    o3l.export_particles(boundary, folder / "boundary.csv")
    o3l.export_particles(boundary, folder / "boundary.bgeo")
    o3l.export_mesh(moved(solid, origin), folder / "boundary.obj")
    ball = o3d.geometry.TriangleMesh.create_sphere(RADIUS, 60).translate((0, 0, top + ABOVE + RADIUS))
    o3l.export_particles(o3l.fill_particles(ball, STEP, unit="mm"), folder / "drop.bgeo")
    still = [0.0, 0.0, 0.0]
    scene = {
        "Configuration": {
            "particleRadius": STEP / 2,
            "simulationMethod": 4,
            "gravitation": [0.0, 0.0, -GRAVITY],
            "cflMethod": 1,
            "cflFactor": 0.5,
            "cflMaxTimeStepSize": 0.005,
            "timeStepSize": 0.001,
            "boundaryHandlingMethod": 0,
        },
        "Materials": [{"id": "Fluid", "density0": 1.0, "viscosityMethod": 1, "viscosity": 0.001}],
        "FluidModels": [
            {"id": "Fluid", "particleFile": "drop.bgeo", "translation": still, "initialVelocity": [0.0, 0.0, -SPEED]}
        ],
        "RigidBodies": [{"geometryFile": "boundary.obj", "particleFile": "boundary.bgeo", "translation": still}],
    }
    (folder / "scene.json").write_text(json.dumps(scene, indent=1), encoding="utf-8")
    (folder / "origin.json").write_text(json.dumps(origin.tolist()), encoding="utf-8")
    print(f"{len(boundary.points):,} particles of the leaf, a droplet {2 * RADIUS:g} mm across")


def run(folder: Path, duration: float) -> None:
    """Let it fall, and keep the places of all particles at some times."""
    import pysplishsplash as sph  # noqa: PLC0415  the two programs live in two environments

    base = sph.Exec.SimulatorBase()
    scene = str((folder / "scene.json").resolve())
    base.init(useGui=False, sceneFile=scene, useCache=False, initialPause=False, outputDir=str(folder), stopAt=duration)
    times, places, counts = [], [], []

    def keep() -> None:
        now = sph.TimeManager.getCurrent().getTime()
        simulation = sph.Simulation.getCurrent()
        if not counts:
            counts.append(simulation.getBoundaryModel(0).numberOfParticles())
        if not times or now - times[-1] >= 0.05:
            fluid = simulation.getFluidModel(0)
            times.append(now)
            places.append([fluid.getPosition(i) for i in range(fluid.numActiveParticles())])

    base.setTimeStepCB(keep)
    base.run()
    np.savez(folder / "drop.npz", times=times, places=np.array(places), boundary=counts)
    print(f"{len(places[-1]):,} particles on {counts[0]:,} of the leaf, {times[-1]:.2f} ms")


def check(model: Path, folder: Path) -> None:
    """Print, at some times, the droplet's height and width, and its least distance to the leaf."""
    import o3dleaf as o3l  # noqa: PLC0415  the two programs live in two environments

    leaf, kept = o3l.load(model), np.load(folder / "drop.npz")
    origin = np.array(json.loads((folder / "origin.json").read_text(encoding="utf-8")))
    rows = range(0, len(kept["times"]), max(len(kept["times"]) // 12, 1))
    worst = np.inf
    for row in rows:
        places = kept["places"][row]
        distance = leaf.signed_distance(places + origin, closed=True)
        worst = min(worst, distance.min())
        low, high = places.min(axis=0), places.max(axis=0)
        print(
            f"{kept['times'][row]:6.2f} ms   top {high[2]:.3f} mm   width {high[0] - low[0]:.3f} x "
            f"{high[1] - low[1]:.3f} mm   nearest to the leaf {distance.min():+.4f} mm, {np.sum(distance < 0)} inside"
        )
    print(f"least distance {worst / STEP:+.2f} of the spacing of particles")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(dest="step", required=True)
    first = steps.add_parser("prepare")
    first.add_argument("model", type=Path)
    first.add_argument("folder", type=Path)
    first.add_argument("--at", type=float, nargs=2, required=True, metavar=("ALONG", "ACROSS"))
    second = steps.add_parser("run")
    second.add_argument("folder", type=Path)
    second.add_argument("--duration", type=float, default=1.5, help="in milliseconds")
    third = steps.add_parser("check")
    third.add_argument("model", type=Path)
    third.add_argument("folder", type=Path)
    given = parser.parse_args()
    if given.step == "prepare":
        prepare(given.model, given.folder, tuple(given.at))
    elif given.step == "run":
        run(given.folder, given.duration)
    else:
        check(given.model, given.folder)


if __name__ == "__main__":
    main()
