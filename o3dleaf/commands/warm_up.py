"""`o3dleaf warm-up`: what the main jobs need is compiled before the first one."""

from dataclasses import dataclass

from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import option
from o3dleaf.core.journal import stage


@dataclass(frozen=True)
class WarmUpJob(LongJob):
    """Compile what the main jobs need, on all cores, once; an installed wheel brings most of it."""

    jobs: str = option(
        "all",
        "Whose functions: those of all main jobs, of the demo, or of the tests, too.",
        choices=("all", "demo", "tests"),
    )

    def work(self) -> int:
        """Compile it, and return how many functions there were to compile."""
        from o3dleaf.core.compiled.warm_up import warm_up

        with stage("compile"):
            return warm_up(workers=self.threads, jobs=self.jobs)

    def line(self, summary: int) -> str:
        """Return what was done."""
        return f"compiled {summary} functions" if summary else "all is compiled"
