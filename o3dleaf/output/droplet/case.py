"""The folder of a case: surfaces, one file of numbers, and OpenFOAM's dictionaries, which stand in `template`."""

import re
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.atomic_files import write_json, write_text
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.units import METERS
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.mesh_data import MeshData
from o3dleaf.io.obj import write_obj
from o3dleaf.output.droplet.box import DropletBox
from o3dleaf.output.droplet.surfaces import VARIANTS, LandingWindow
from o3dleaf.output.droplet.units import LENGTH, TIME, Impact
from o3dleaf.output.droplet.written import SETTINGS

RIPPLE = 0.5
"""Share of the longest step that capillary waves allow."""


@dataclass(frozen=True)
class DropletCase:
    """All that a case is made of.

    Attributes
    ----------
    impact : Impact
    box : DropletBox
    duration, frame : float
        Seconds that are simulated, and between two pictures.
    about : mapping
        What else its settings are to say.
    """

    impact: Impact
    box: DropletBox
    duration: float
    frame: float
    about: Mapping[str, Any]

    def write(self, folder: Path, surfaces: Mapping[str, LabelledMesh]) -> None:
        """Write the case into an empty folder: settings, numbers, a script, and a folder for each surface."""
        template = files("o3dleaf.output.droplet") / "template"
        for name in ("constants", "README.md"):
            write_text(filled((template / name).read_text(encoding="utf-8"), self.numbers()), folder / name)
        script = folder / "run"
        write_text((template / "run").read_text(encoding="utf-8"), script)
        script.chmod(0o755)
        for name, surface in surfaces.items():
            variant = folder / name
            for source in sorted(Path(str(template / "variant")).rglob("*")):
                if source.is_file():
                    target = variant / source.relative_to(str(template / "variant"))
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(source, target)
            write_surface(surface, variant / "constant" / "triSurface" / "leaf.obj", name)
        settings = {"impact": asdict(self.impact), "box": asdict(self.box), "variants": list(surfaces)}
        times = {"duration": self.duration, "frame": self.frame, "length_unit": LENGTH, "time_unit": TIME}
        write_json({**settings, **times, **self.about}, folder / SETTINGS)

    def numbers(self) -> dict[str, str]:
        """Return what stands between two @ in the templates."""
        si, scaled, box = self.impact, self.impact.scaled(), self.box
        step = RIPPLE * si.capillary_step(box.cell)
        lengths = {
            "diameter": si.diameter,
            "radius": si.diameter / 2,
            "radius_set": si.diameter / 2 + 2 * box.cell,
            "x_drop": 0.0,
            "y_drop": 0.0,
            "z_drop": box.start,
            "cell": box.cell,
            "x_min": -box.half,
            "x_max": box.half,
            "y_min": -box.half,
            "y_max": box.half,
            "z_min": box.bottom,
            "z_max": box.top,
            # Over the droplet, and on no face of a cell.
            "x_inside": 0.37 * box.cell,
            "y_inside": 0.41 * box.cell,
            "z_inside": box.top - 0.43 * box.cell,
        }
        times = {"end_time": self.duration, "frame": self.frame, "delta_t": step / 10, "max_delta_t": step}
        fluids = {
            "rho_liquid": (scaled.density, si.density),
            "rho_gas": (scaled.gas_density, si.gas_density),
            "nu_liquid": (scaled.viscosity, si.viscosity),
            "nu_gas": (scaled.gas_viscosity, si.gas_viscosity),
        }
        pairs = {name: (value / LENGTH, value) for name, value in lengths.items()}
        pairs |= {name: (value / TIME, value) for name, value in times.items()} | fluids
        pairs |= {f"{axis}_gravity": (scaled.gravity[k], si.gravity[k]) for k, axis in enumerate("xyz")}
        found = {name: f"{value:.10g}" for name, (value, _) in pairs.items()}
        found |= {f"si_{name}": f"{value:.6g}" for name, (_, value) in pairs.items()}
        plain = {"speed": si.speed, "z_speed": -si.speed, "tension": si.tension, "angle": si.angle}
        found |= {name: f"{value:.10g}" for name, value in plain.items()}
        found |= {f"{axis}_cells": str(count) for axis, count in zip("xyz", box.cells, strict=True)}
        found["numbers"] = f"We {si.weber:.4g}, Re {si.reynolds:.4g}, Bo {si.bond:.4g}"
        found["length_unit"], found["time_unit"] = f"{LENGTH * 1e6:g} µm", f"{TIME * 1e6:g} µs"
        found["cells"] = f"{np.prod(box.cells):,}"
        found["si_duration_ms"] = f"{self.duration * 1e3:g}"
        found["about"] = str(self.about.get("title", ""))
        return found


def filled(text: str, values: Mapping[str, str]) -> str:
    """Return a template with what stands between two @ replaced."""
    return re.sub(r"@(\w+)@", lambda found: values[found[1]], text)


def write_surface(surface: LabelledMesh, path: Path, name: str) -> None:
    """Write a surface as OBJ with a group for each label, in the solver's unit of length."""
    if surface.unit is None:
        raise InputError("model: states no unit, and a droplet has a size; make the leaf of a scan with a unit")
    vertices, triangles = mesh_arrays(surface.mesh)
    scaled = MeshData(vertices * (METERS[surface.unit] / LENGTH), triangles, surface.labels, surface.names)
    path.parent.mkdir(parents=True)
    with path.open("wb") as out:
        write_obj(out, scaled, (f"o3dleaf droplet {name}, lengths in {LENGTH * 1e6:g} micrometers",))


def make_case(
    window: LandingWindow,
    impact: Impact,
    *,
    cell: float,
    duration: float,
    frame: float,
    about: Mapping[str, Any],
) -> tuple[DropletCase, dict[str, LabelledMesh]]:
    """Return the case of a landing place, and its surfaces: lengths in meters, times in seconds.

    Box and start are those of the leaf for all of them.
    """
    unit = METERS[window.leaf.unit or "m"]
    surfaces = {name: window.surface(name) for name in VARIANTS}
    solid = window.surface("leaf")
    vertices, triangles = mesh_arrays(solid.mesh)
    face = vertices[np.unique(triangles[solid.labels == 0])] * unit
    box = DropletBox.around(face, impact, window.size * unit, cell)
    pose = {
        "place": list(window.place),
        "origin": window.frame.origin.tolist(),
        "axes": window.frame.axes.tolist(),
        "unit": window.leaf.unit,
        "surface_step": window.step,
    }
    return DropletCase(impact, box, duration, frame, {**about, **pose}), surfaces
