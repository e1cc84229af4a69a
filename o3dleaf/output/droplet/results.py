"""The results of a case: one table, pictures, an animation, and a page with the curves."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import write_text
from o3dleaf.core.journal import note
from o3dleaf.output.droplet.page import figures_table, write_page
from o3dleaf.output.droplet.pictures import DropletStage, chosen_times, common_times, write_animation, write_stills
from o3dleaf.output.droplet.readings import DropletReadings, table_of
from o3dleaf.output.droplet.units import LENGTH
from o3dleaf.output.droplet.written import WrittenCase

TABLE, STILLS, ANIMATION, PAGE = "droplet.csv", "droplet.png", "droplet.gif", "droplet.html"
"""What is written into the folder of a case."""
HELD = 1e-3
"""Relative change of the volume beyond which a run has failed."""


@dataclass(frozen=True, eq=False)
class DropletResults:
    """Readings of all runs of a folder.

    Attributes
    ----------
    folder : Path
    cases : mapping of str to WrittenCase
        The case of each run.
    courses : mapping of str to DropletReadings
        The runs by name: leaf, twin; of several landing places 1_ridge/leaf and so on.
    """

    folder: Path
    cases: Mapping[str, WrittenCase]
    courses: Mapping[str, DropletReadings]

    @classmethod
    def read(cls, folder: Path, wanted: Mapping[WrittenCase, tuple[str, ...]]) -> "DropletResults":
        """Return what the runs of some cases have written."""
        places = {
            (case.folder / name).relative_to(folder).as_posix(): (case, name)
            for case, names in wanted.items()
            for name in names
        }
        cases, courses = dict[str, WrittenCase](), dict[str, DropletReadings]()
        for number, (run, (case, name)) in enumerate(places.items()):
            cases[run], courses[run] = case, DropletReadings.read(case.folder / name)
            progress.report(number + 1, len(places))
        return cls(folder, cases, courses)

    @cached_property
    def summaries(self) -> dict[str, dict[str, float]]:
        """The figures of each run."""
        return {run: each.summary(self.cases[run].constant("diameter") * LENGTH) for run, each in self.courses.items()}

    @cached_property
    def failures(self) -> dict[str, str]:
        """Of each run that is not to be used, why: its droplet is lost, or meets the mirrors at the sides."""
        found = dict[str, str]()
        for run, figures in self.summaries.items():
            box, cell, diameter = (self.cases[run].constant(name) for name in ("xMax", "cell", "diameter"))
            widest = max(figures["largest_width_along"], figures["largest_width_across"])
            if figures["volume_drift"] > HELD:
                found[run] = (
                    f"{run} has failed: its volume changes by {figures['volume_drift']:.2g} of itself, and air is as "
                    f"fast as {figures['fastest_m_s']:.3g} m/s; do not use its figures, try other cells (export --cell)"
                )
            elif widest * diameter > 2 * box - cell:  # the interface is thicker than what is left
                found[run] = (
                    f"{run} has failed: its droplet meets the mirrors at the sides; do not use its figures, make the "
                    "window wider (export --size)"
                )
        return found

    @property
    def spread(self) -> dict[str, tuple[float, float]]:
        """Mean and standard deviation of each figure over the landing places of the leaf; none of a single one.

        Without those whose run has failed.
        """
        leaves = [self.summaries[run] for run in self.summaries if run.endswith("leaf") and run not in self.failures]
        if len(leaves) < 2:
            return {}
        values = {name: np.array([each[name] for each in leaves]) for name in leaves[0]}
        return {name: (float(each.mean()), float(each.std(ddof=1))) for name, each in values.items()}

    def write_table(self) -> None:
        """Write all rows of all runs as one table."""
        write_text(table_of(dict(self.courses)), self.folder / TABLE)

    def draw(self) -> None:
        """Write pictures of the first landing place side by side, the animation, and the page."""
        first = next(iter(self.cases.values()))
        shown = {run: course for run, course in self.courses.items() if self.cases[run] is first}
        half = first.constant("xMax") * LENGTH * 1e3
        top = max(float(course.column("height").max()) for course in shown.values()) * 1e3
        stages = [DropletStage.of(self.folder / run, course, half, top) for run, course in shown.items()]
        times = common_times(shown)
        figures = self.summaries[next(iter(shown))]
        end = figures["lift_off_ms"] / 1e3 if np.isfinite(figures["lift_off_ms"]) else times[-1]
        stilling, moving = progress.split(6, len(times))
        with stilling:
            write_stills(stages, chosen_times(times, figures["touch_ms"] / 1e3, end), self.folder / STILLS)
        with moving:
            write_animation(stages, times, self.folder / ANIMATION)
        about = str(first.settings.get("title", ""))
        figures_of_all = figures_table(self.summaries, self.spread, [*self.failures.values()])
        write_page(self.folder / PAGE, about, figures_of_all, self.courses, (STILLS, ANIMATION))

    def warn(self) -> None:
        """Name the runs that have failed."""
        for failure in self.failures.values():
            note(f"warning: {failure}")

    def line(self) -> str:
        """Return the figures of the leaf and where the rest is."""
        figures = next(iter(self.summaries.values()))
        return (
            f"{self.folder / PAGE}: largest width {figures['largest_width_along']:.3g} diameters along, "
            f"{figures['largest_width_across']:.3g} across, volume to {figures['volume_drift']:.1e}"
        )
