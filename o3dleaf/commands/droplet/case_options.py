"""`o3dleaf export --for droplet`: the options of a case of a droplet on a leaf, and the case of them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from o3dleaf.core.arguments.kinds import Count, Positive, Whole
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.option import option
from o3dleaf.core.journal import note, stage

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf
    from o3dleaf.output.droplet.surfaces import LandingWindow

OF_CASE: dict[str, Any] = {"needs": ("consumer=droplet",)}
"""Of options that only a case of a droplet has a use for."""
OF_DROP: dict[str, Any] = {"needs": ("consumer=droplet", "consumer=evolver")}
"""Of options that a drop at rest (Surface Evolver) has a use for, too."""
MESH_ONLY = ("what", "to_unit", "remesh", "no_remesh", "region", "part", "sheets", "tile", "origin", "scalar")
"""Options of an export that a case has no use for."""
GRAVITY = 9.81
"""m/s²."""


@dataclass(frozen=True, kw_only=True)
class DropletOptions:
    """A droplet, and where it lands: lengths in millimeters, the place in the leaf's coordinates."""

    HEADING: ClassVar = "Droplet"

    at: tuple[float, float] | None = option(
        None, "Place where the droplet lands, ALONG ACROSS in leaf coordinates.", **OF_DROP
    )
    size: Positive = option(1.2, "Width of the window around it", unit="mm", **OF_CASE)
    diameter: Positive = option(0.6, "Diameter of the droplet", unit="mm", **OF_DROP)
    speed: Positive = option(0.5, "Speed of the droplet against the leaf's normal", unit="m/s", **OF_CASE)
    angle: Positive = option(150.0, "Static contact angle", unit="degrees", **OF_DROP)
    cell: Positive = option(0.035, "Edge of the solver's cells", unit="mm", **OF_CASE)
    duration: Positive = option(3.0, "Time to simulate", unit="ms", **OF_CASE)
    frame: Positive = option(0.05, "Time between two pictures", unit="ms", **OF_CASE)
    down: tuple[float, float, float] | None = option(
        None, "Where gravity points in the world, X Y Z; by default 0 0 -1.", **OF_CASE
    )
    landings: Count = option(
        1,
        "Landing places, chosen around it in turn on a ridge, in a furrow, on a hair; a case for each.",
        "--points",
        **OF_CASE,
    )
    seed: Whole = option(0, "Random seed of the landing places.", **OF_CASE)

    def check_case(self, job: Any) -> None:
        """Refuse, of the export that these are options of, what a case cannot be made of."""
        from o3dleaf.core.atomic_files import require_replaceable
        from o3dleaf.output.droplet.written import RESULTS, SETTINGS

        self.check_place(job, "droplet")
        if self.down is not None and not any(self.down):
            raise InputError("down: is 0 0 0; give a direction")
        require_replaceable(job.output, SETTINGS, RESULTS)

    def check_place(self, job: Any, program: str) -> None:
        """Refuse what neither a case nor a drop at rest can be made of."""
        for name in MESH_ONLY:
            if job.has(name):
                raise InputError(f"{name.replace('_', '-')}: cannot act with for {program}; leave one of them out")
        if not job.saved_model:
            raise InputError(f"for: {program} needs the model of a leaf, and {job.source} is none; give a .o3l file")
        if self.at is None:
            raise InputError("at: is missing; give the place where the droplet lands, --at ALONG ACROSS")
        if not self.angle < 180:
            raise InputError(f"angle: is {self.angle:g}; give the contact angle, between 0 and 180 degrees")

    def write_static_drop(self, source: Path, output: Path) -> str:
        """Write a drop at rest for Surface Evolver; return a line about it."""
        from o3dleaf.output.static_drop.evolver import WHERE, has_evolver, write_drop
        from o3dleaf.output.static_drop.site import drop_on_leaf

        with stage("read"):
            leaf = self.leaf_of(source)
        along, across = self.at or (0.0, 0.0)
        about = f"A drop on {source.name}, at along {along:.6g}, across {across:.6g}, on the mean adaxial surface."
        with stage("surface"):
            drop = drop_on_leaf(leaf, (along, across), angle=self.angle, diameter=self.diameter, about=about)
        write_drop(drop, output)
        if not has_evolver():
            note(f"Surface Evolver is not here, and the file is complete without it; to run it, {WHERE}")
        return "a drop at rest; in Surface Evolver, the commands settle and say"

    def write_cases(self, source: Path, output: Path, spacing: float | None) -> str:
        """Write the case, or one for each landing place, whole or not at all; return a line about it."""
        from o3dleaf.core.atomic_files import whole_folder, write_json
        from o3dleaf.core.units import tell_count, unit_scale
        from o3dleaf.output.droplet.solver import WHERE, missing_tools
        from o3dleaf.output.droplet.surfaces import LandingWindow
        from o3dleaf.output.droplet.written import RESULTS, SETTINGS

        with stage("read"):
            leaf = self.leaf_of(source)
            unit = unit_scale("mm", leaf.unit)
            step = spacing or 0.7 * self.cell * unit
            places = self.places(leaf, unit)
        with whole_folder(output, SETTINGS, RESULTS) as folder:
            for number, (kind, place) in enumerate(places, 1):
                name = f"{number}_{kind}" if len(places) > 1 else ""
                with stage(f"case {name}".strip()):
                    self.write_case(folder / name, LandingWindow(leaf, place, self.size * unit, step), source, kind)
            if len(places) > 1:
                cases = [f"{number}_{kind}" for number, (kind, _) in enumerate(places, 1)]
                write_json({"cases": cases, "seed": self.seed}, folder / SETTINGS)
        if missing_tools():
            note(f"OpenFOAM is not here, and the case is complete without it; to run it, {WHERE}")
        return f"{tell_count(len(places), 'case')} of a droplet; run with o3dleaf droplet {output}"

    def places(self, leaf: "MultiscaleLeaf", unit: float) -> list[tuple[str, tuple[float, float]]]:
        """Return the kinds of landing places and where they are; of a single one the kind is not known."""
        from o3dleaf.output.droplet.landing import choose_places

        at = self.at or (0.0, 0.0)
        if self.landings == 1:
            return [("", at)]
        return choose_places(leaf, at, self.landings, self.seed, self.size * unit, unit)

    def write_case(self, folder: Path, window: "LandingWindow", source: Path, kind: str) -> None:
        """Write one case."""
        import numpy as np

        from o3dleaf.output.droplet.case import make_case
        from o3dleaf.output.droplet.units import Impact

        down = np.array(self.down or (0.0, 0.0, -1.0))
        pull = GRAVITY * down / np.linalg.norm(down)
        gravity = window.frame.turn((float(pull[0]), float(pull[1]), float(pull[2])))
        impact = Impact(self.diameter * 1e-3, self.speed, self.angle, gravity)
        along, across = window.place
        title = (
            f"A droplet of {self.diameter:g} mm at {self.speed:g} m/s, contact angle {self.angle:g}°, on "
            f"{source.name}, at along {along:.4g}, across {across:.4g}{f' ({kind})' if kind else ''}."
        )
        about = {"title": title, "model": source.name, "kind": kind}
        case, surfaces = make_case(
            window,
            impact,
            cell=self.cell * 1e-3,
            duration=self.duration * 1e-3,
            frame=self.frame * 1e-3,
            about=about,
        )
        folder.mkdir(exist_ok=True)
        case.write(folder, surfaces)

    @staticmethod
    def leaf_of(source: Path) -> "MultiscaleLeaf":
        """Return the leaf of a model."""
        from o3dleaf.leaf.multiscale import MultiscaleLeaf
        from o3dleaf.leaf.saved.models import load

        leaf = load(source)
        if not isinstance(leaf, MultiscaleLeaf):
            raise InputError(f"{source}: contains a {type(leaf).__name__}; a droplet needs the model of a leaf")
        if leaf.unit is None:
            raise InputError(f"{source}: states no unit, and a droplet has a size; make the leaf of a scan with a unit")
        return leaf
