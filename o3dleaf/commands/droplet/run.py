"""`o3dleaf droplet`: a case that was written is run and read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import argument, option
from o3dleaf.core.journal import stage

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need

SHORTER = 2.5
"""Times as many steps as on a smooth face: in furrows and beside hairs air is fast."""


@dataclass(frozen=True)
class DropletJob(LongJob):
    """Run a case of `export --for droplet` with OpenFOAM, leaf and twin side by side: table, pictures and a page.

    A run that was stopped goes on where it was. Results are written into the case.
    """

    case: Path = argument("Folder that o3dleaf export --for droplet has written.")
    bare: bool = option(False, "Run the leaf without hairs as well.")
    only_read: bool = option(False, "Run nothing; read what is there, finished or not.", "--read")

    def check(self) -> None:
        """Refuse what is no case."""
        from o3dleaf.output.droplet.written import find_cases

        super().check()
        find_cases(self.case)

    def estimate(self) -> "list[Need]":
        """Return what the solvers that run side by side hold, and the processor time of all of them."""
        from o3dleaf.core.parallel import get_num_threads
        from o3dleaf.core.resources.measured import SOLVED_CELL, SOLVED_STEP, SOLVER, Cost
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.output.droplet.written import find_cases

        runs = [(case, name) for n, case in enumerate(find_cases(self.case)) for name in self.variants(n)]
        if self.only_read:
            runs = []
        beside = min(len(runs), self.threads or get_num_threads())
        cells = max((case.cells for case, _ in runs), default=0.0)
        steps = sum(case.cells * case.steps * (1.0 if name == "twin" else SHORTER) for case, name in runs)
        held = sum(((SOLVER + SOLVED_CELL * cells) for _ in range(beside)), Cost(0))
        what = f"droplet: {len(runs)} runs of {cells:,.0f} cells"
        return [need_of(held + SOLVED_STEP * steps, what, "give fewer threads, or larger cells (export --cell)")]

    def work(self) -> str:
        """Run, read, draw; return a line about it."""
        from o3dleaf.core.parallel import get_num_threads
        from o3dleaf.output.droplet.results import DropletResults
        from o3dleaf.output.droplet.solver import SolverRun, require_openfoam, solve_all
        from o3dleaf.output.droplet.written import find_cases

        cases = find_cases(self.case)
        wanted = {case: self.variants(number) for number, case in enumerate(cases)}
        if not self.only_read:
            require_openfoam()
            with stage("run"):
                runs = [SolverRun(case.folder / name, case.duration) for case in cases for name in wanted[case]]
                solve_all(runs, get_num_threads())
        with stage("read"):
            results = DropletResults.read(self.case, wanted)
            results.write_table()
            results.warn()
        with stage("draw"):
            results.draw()
        return results.line()

    def variants(self, number: int) -> tuple[str, ...]:
        """Return what is run of a case: of several landing places, one smooth twin is enough."""
        return ("leaf", *("twin",) * (number == 0), *("bare",) * self.bare)

    def line(self, summary: str) -> str:
        """Return what was found."""
        return summary
