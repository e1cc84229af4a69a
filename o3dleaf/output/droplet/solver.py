"""OpenFOAM at work on a case: several runs side by side, their progress, and their end."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import IO

from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.progress import report
from o3dleaf.output.droplet.units import TIME

TOOLS = ("blockMesh", "snappyHexMesh", "checkMesh", "setAlphaField", "setFields", "interFoam")
WHERE = "on Debian: apt-get install -y --no-install-recommends openfoam (1 GB), elsewhere: source its etc/bashrc"
POLL = 0.5
"""Seconds between two looks at the logs."""
PATIENCE = 60.0
"""Seconds that a solver has to write its state when it is stopped."""
TAIL = 1 << 14
"""Bytes of a log that hold its last time."""


@dataclass
class SolverRun:
    """One variant of a case.

    Attributes
    ----------
    folder : Path
        Of the variant, within that of the case.
    duration : float
        Seconds that are simulated.
    """

    folder: Path
    duration: float
    process: subprocess.Popen[bytes] | None = None

    @property
    def reached(self) -> float:
        """Simulated seconds so far: a run that went on has the log of those before beside its own."""
        return max(last_time(self.folder / name) for name in ("log.solver", "log.solver.before")) * TIME

    @property
    def finished(self) -> bool:
        """Whether it has come to its end."""
        return self.reached >= self.duration * (1 - 1e-6)

    def start(self, processes: int) -> None:
        """Start the script of the case on this variant, in a session of its own: Ctrl-C reaches this program alone."""
        log: IO[bytes]
        with (self.folder / "log.run").open("wb") as log:
            self.process = subprocess.Popen(  # noqa: S603  the script is the case's own
                ["/bin/bash", "run", self.folder.name],
                cwd=self.folder.parent,
                env=os.environ | {"PROCESSES": str(processes)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def stop(self) -> None:
        """Have the solver write its state and stop; if it does not, end it."""
        if self.process is None or self.process.poll() is not None:
            return
        self.process.terminate()  # the script hands it on, and waits
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(PATIENCE)
        if sys.platform != "win32":
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def require_success(self) -> None:
        """Raise `O3DLeafError` if it ended before its end."""
        code = None if self.process is None else self.process.returncode
        if not code and self.finished:
            return
        said = (self.folder / "log.run").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        why = said[-1].removeprefix("run: ") if said else f"exit code {code}"
        raise O3DLeafError(
            f"{self.folder}: the solver ended at {self.reached * 1e3:.3g} of {self.duration * 1e3:g} ms ({why}); read "
            "its logs, and if its mesh or steps are at fault, change cell or constants and begin anew"
        )


def missing_tools() -> list[str]:
    """Return the programs that a run needs and that are not there."""
    return [tool for tool in (*TOOLS, "bash") if shutil.which(tool) is None]


def require_openfoam() -> None:
    """Raise `InputError`, which says how to get it, if OpenFOAM is not there."""
    missing = missing_tools()
    if missing:
        raise InputError(f"OpenFOAM: {', '.join(missing)} not found; {WHERE}")


def solve_all(runs: Sequence[SolverRun], cores: int) -> None:
    """Run what has not come to its end, as many side by side as there are cores, and share the cores among them.

    Progress is that of simulated time. An interruption, SIGTERM too, stops the solvers, which write their state first.

    Raises
    ------
    O3DLeafError
        If one ends before its end.
    """
    waiting = [run for run in runs if not run.finished]
    beside = max(1, min(len(waiting), cores))
    running: list[SolverRun] = []
    total = sum(run.duration for run in runs)
    with interrupted_by_terminate():
        try:
            while waiting or running:
                while waiting and len(running) < beside:
                    running.append(waiting.pop(0))
                    running[-1].start(max(1, cores // beside))
                time.sleep(POLL)
                report(round(1e9 * sum(run.reached for run in runs)), round(1e9 * total))
                for run in [each for each in running if each.process and each.process.poll() is not None]:
                    running.remove(run)
                    run.require_success()
        finally:
            for run in running:
                if run.process:
                    run.process.terminate()
            for run in running:
                run.stop()


@contextmanager
def interrupted_by_terminate() -> Iterator[None]:
    """Make SIGTERM an interruption like Ctrl-C, where nobody handles it, so that solvers do not outlive us."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        del number, frame
        raise KeyboardInterrupt

    # The command line has a handler of its own; and only the main thread can set one.
    ours = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL and threading.current_thread() is threading.main_thread()
    if ours:
        signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def last_time(log: Path) -> float:
    """Return the last time in a log of the solver, in its own unit; 0 where there is none."""
    try:
        with log.open("rb") as opened:
            opened.seek(max(0, log.stat().st_size - TAIL))
            lines = opened.read().decode("ascii", "replace").splitlines()
    except FileNotFoundError:
        return 0.0
    for line in reversed(lines):
        if line.startswith("Time = "):
            with suppress(ValueError):  # half a line
                return float(line.removeprefix("Time = "))
    return 0.0
