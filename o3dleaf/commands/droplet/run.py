"""`o3dleaf droplet`: a case that was written is run and read."""

from dataclasses import dataclass
from pathlib import Path

from o3dleaf.core.job import LongJob, argument, option
from o3dleaf.core.journal import stage


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
        from o3dleaf.output.droplet.case import find_cases

        super().check()
        find_cases(self.case)

    def work(self) -> str:
        """Run, read, draw; return a line about it."""
        from o3dleaf.core.parallel import get_num_threads
        from o3dleaf.output.droplet.case import find_cases
        from o3dleaf.output.droplet.results import DropletResults
        from o3dleaf.output.droplet.solver import SolverRun, require_openfoam, solve_all

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
        with stage("draw"):
            results.draw()
        return results.line()

    def variants(self, number: int) -> tuple[str, ...]:
        """Return what is run of a case: of several landing places, one smooth twin is enough."""
        return ("leaf", *("twin",) * (number == 0), *("bare",) * self.bare)

    def line(self, summary: str) -> str:
        """Return what was found."""
        return summary
