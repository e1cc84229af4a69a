"""Mutation testing: change one place of the code at random, and see whether a test of its chapter notices.

python scripts/mutate.py [CHAPTER ...] [--count N] [--seed S] [--json FILE] [--jobs N]

It takes hours. With --json, what is known is in the file after every mutant, and is not tried again by a later run;
the table at the end has all that the file knows.

Chapters are those below, or any folder of the package; without one, all of these. The tests are those of the same
folder (tests/fitting/rbf for fitting/rbf), and of the same part of the story (tests/fitting) those that speak of the
changed file; what is near and cheap comes first (mutation_order.py), and the first that fails ends them. Tests marked
slow are left out. It is done in a copy of the checkout, a job each, with the machine code that the checkout has
compiled: it is found by the source that it was made from, so that what depends on a mutant is compiled anew, for this
mutant alone, and nothing else is. Tests of which the file does not know how long they take run without a mutant first.

A mutant is killed if a test fails, or takes far longer than without it. What survives is printed with its place, to be
looked at: some changes show what no test holds; some change nothing, or only how fast a result is reached. These may be
entered into the file as "equivalent", with the reason in place of what noticed it: they are not tried, nor counted in
the score.
"""

import argparse
import compileall
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from py_compile import PycInvalidationMode
from queue import SimpleQueue

from mutants import Mutant, mutants_of
from rich.box import MARKDOWN
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from o3dleaf.core.atomic_files import write_json

ROOT = Path(__file__).resolve().parents[1]
CHAPTERS = {
    "fitting/rbf": ("fitting/rbf",),
    "fitting/pu": ("fitting/cover", "fitting/local", "fitting/pu"),
    "leaf's surface": ("leaf/macro", "leaf/sheet", "leaf/chart", "leaf/margin", "leaf/parametric"),
    "tiles": ("leaf/texture", "leaf/instancing", "leaf/distance"),
    "reconstruction": ("surface/cloud", "surface/creases", "surface/isosurface", "surface/reconstruction"),
}
"""Folders of the package, and of its tests, by chapter."""

PATIENCE = 10.0
"""Times that all tests may take, on the clock, of the processor time that they take without a mutant: some wait."""
BEGINNING = 600.0
"""Seconds that they may take besides, for compiling."""

NO_TESTS = 5
"""How pytest ends where all tests are left out."""

RUNNING: set[int] = set()
"""The process groups of the tests of the moment."""
ENDING = threading.Event()
"""Set when this program is to end."""

RESULTS = ("killed", "ran past the limit", "survived", "equivalent")


@dataclass(frozen=True)
class Outcome:
    """What became of the change at a place, one of `RESULTS`, the processor time of its tests, and what noticed it."""

    chapter: str
    place: str
    result: str
    seconds: float
    by: str = ""


class Checkout:
    """A copy of the checkout in which one file at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "checkout"
        shutil.copytree(
            ROOT, self.root, symlinks=True, ignore=shutil.ignore_patterns(".git", ".*_cache", "__pycache__")
        )
        compileall.compile_dir(self.root / "o3dleaf", quiet=1, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
        if (ROOT.parent / "shared").exists():  # real scans, which some tests read
            (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
        self.compiled, self.shipped = folder / "compiled", self.root / "o3dleaf/core/compiled/machine_code"
        self.ship(ROOT / "o3dleaf")

    def ship(self, folder: Path) -> None:
        """Have all machine code below a folder loaded, where it is current, as if the package had brought it."""
        self.shipped.mkdir(exist_ok=True)
        for file in (*folder.rglob("*.code"), *folder.rglob("*.callee")):
            shutil.copyfile(file, self.shipped / file.name)

    def mutants(self, folders: tuple[str, ...]) -> list[Mutant]:
        """Return all mutants of some folders."""
        files = [file for folder in folders for file in sorted((self.root / "o3dleaf" / folder).rglob("*.py"))]
        return [mutant for file in files if file.name != "__init__.py" for mutant in mutants_of(file)]

    def tests(self, folders: tuple[str, ...], mutant: Mutant | None = None) -> dict[str, int]:
        """Return the test files for some folders, the nearest first, and by how many steps others are farther.

        They are their own, and of the same part those that use a mutant's module. What speaks of the mutant is
        nearest, then what imports its module, or a module that imports it.
        """
        own = [self.root / "tests" / folder for folder in folders]
        parts = {Path(folder).parts[0] for folder in folders}
        files = [file for part in sorted(parts) for file in sorted((self.root / "tests" / part).rglob("test_*.py"))]
        users = [] if mutant is None else self.users(mutant.path, parts)

        def nearness(file: Path) -> tuple[bool, ...]:
            at_home = any(file.is_relative_to(folder) for folder in own)
            if mutant is None:
                return (at_home,)
            text, stem = file.read_text(), mutant.path.stem.removesuffix("_loops")
            name = mutant.scope.rpartition(".")[2]
            spoken = at_home and stem in file.stem, at_home and bool(name) and name in text, stem in text
            return *spoken, *(any(module in text for module in modules) for modules in users), at_home

        near = {str(file.relative_to(self.root)): nearness(file) for file in files}
        ranks = sorted({rank for rank in near.values() if mutant is None or any(rank)}, reverse=True)
        steps = {file: ranks.index(rank) for file, rank in near.items() if rank in ranks}
        return dict(sorted(steps.items(), key=lambda each: each[1]))

    def users(self, path: Path, parts: set[str]) -> list[set[str]]:
        """Return the modules of some parts that import a file, those that import these, and so on."""
        texts = {
            file.relative_to(self.root).with_suffix("").as_posix().replace("/", "."): file.read_text()
            for part in parts
            for file in (self.root / "o3dleaf" / part).rglob("*.py")
            if file.name != "__init__.py"
        }
        rings = [{path.relative_to(self.root).with_suffix("").as_posix().replace("/", ".")}]
        while rings[-1]:
            found = {
                name for name, text in texts.items() if any(f"from {module} import" in text for module in rings[-1])
            }
            rings.append(found.difference(*rings))
        return rings[:-1]

    def run(self, steps: dict[str, int], known: dict[str, float]) -> tuple[int | None, float, dict]:
        """Return how test files end (None: too late), the processor time, and what the plugin tells."""
        if ENDING.is_set():
            sys.exit(143)
        shutil.rmtree(self.compiled, ignore_errors=True)
        self.compiled.mkdir()
        (self.compiled / "given.json").write_text(json.dumps({"steps": steps, "seconds": known}))
        paths = os.pathsep.join((str(self.root), str(self.root / "scripts")))
        kept = {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(self.compiled), "MUTATION_FOLDER": str(self.compiled)}
        options = ("-x", "-q", "-p", "no:cacheprovider", "-p", "mutation_order")
        process = subprocess.Popen(
            [sys.executable, "-m", "pytest", *options, *steps],
            cwd=self.root,
            env={**os.environ, **kept},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        usual = sum(seconds for name, seconds in known.items() if name.partition("::")[0] in steps)
        limit = PATIENCE * usual + BEGINNING if known else 3600.0
        timer = threading.Timer(limit, os.killpg, (process.pid, signal.SIGKILL))
        timer.start()
        RUNNING.add(process.pid)
        _, status, used = os.wait4(process.pid, 0)
        RUNNING.discard(process.pid)
        timer.cancel()
        if ENDING.is_set():
            sys.exit(143)
        process.returncode = os.waitstatus_to_exitcode(status)  # so that nobody waits for it again
        late = process.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
        told = self.compiled / "told.json"
        return (
            None if late else process.returncode,
            used.ru_utime + used.ru_stime,
            json.loads(told.read_text()) if told.exists() else {},
        )

    def outcome(self, chapter: str, mutant: Mutant, known: dict[str, float]) -> Outcome:
        """Return what becomes of a mutant."""
        where, original = place(self, mutant), mutant.path.read_bytes()
        steps = self.tests(CHAPTERS.get(chapter, (chapter,)), mutant)
        mutant.path.write_bytes(mutant.source())
        try:
            code, seconds, told = self.run(steps, known)
        finally:
            mutant.path.write_bytes(original)
        result = RESULTS[1 if code is None else 2 * (code == 0)]
        return Outcome(chapter, where, result, round(seconds, 1), told.get("failed", ""))

    def learn(self, chapter: str, known: dict[str, float]) -> dict[str, float]:
        """Return the seconds of a chapter's tests, and keep what they compile; those not known are run."""
        measured = {name.partition("::")[0] for name in known}
        steps = self.tests(CHAPTERS.get(chapter, (chapter,)))
        new = {file: step for file, step in steps.items() if file not in measured}
        if not new:
            return {}
        code, _, told = self.run(new, {})
        if code not in {0, NO_TESTS}:
            sys.exit(f"{chapter}: {told.get('failed', 'a test')} fails without any mutant; mend it first")
        self.ship(self.compiled)
        return {**dict.fromkeys(new, 0.0), **told["seconds"]}


def end(*_: object) -> None:
    """End the tests of the moment, and this program."""
    ENDING.set()
    for process in list(RUNNING):
        os.killpg(process, signal.SIGKILL)
    sys.exit(143)


def place(checkout: Checkout, mutant: Mutant) -> str:
    """Return where a mutant is and what it changes."""
    return f"{mutant.path.relative_to(checkout.root)}:{mutant.line}: {mutant.change()}"


class Known:
    """What earlier runs found, and this one: in a file, if one is given."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.file, self.seed, self.lock = given.json, given.seed, threading.Lock()
        kept = json.loads(self.file.read_text()) if self.file and self.file.exists() else {}
        self.outcomes = {each.place: each for each in (Outcome(**row) for row in kept.get("mutants", ()))}
        self.seconds: dict[str, float] = kept.get("seconds", {})

    def add(self, outcomes: list[Outcome], seconds: dict[str, float]) -> None:
        """Keep what is new."""
        with self.lock:
            self.outcomes |= {each.place: each for each in outcomes}
            self.seconds |= seconds
            if self.file:
                rows = [asdict(each) for each in self.outcomes.values()]
                write_json({"seed": self.seed, "mutants": rows, "seconds": self.seconds}, self.file)


def mutate(checkouts: list[Checkout], chapter: str, known: Known, count: int) -> None:
    """Find out what becomes of random mutants of a chapter, with progress."""
    free: SimpleQueue[Checkout] = SimpleQueue()
    for each in checkouts:
        free.put(each)
    known.add([], checkouts[0].learn(chapter, known.seconds))
    for each in checkouts[1:]:
        each.ship(checkouts[0].shipped)
    drawn = checkouts[0].mutants(CHAPTERS.get(chapter, (chapter,)))
    random.Random(known.seed).shuffle(drawn)
    drawn, console = drawn[:count], Console(stderr=True)
    places = [place(checkouts[0], mutant) for mutant in drawn]  # before any job changes a file

    def attempt(mutant: Mutant, where: str) -> None:
        if where not in known.outcomes:
            checkout = free.get()
            try:
                path = checkout.root / mutant.path.relative_to(checkouts[0].root)
                known.add([checkout.outcome(chapter, replace(mutant, path=path), known.seconds)], {})
            finally:
                free.put(checkout)
            if known.outcomes[where].result == "survived":
                console.print(where, highlight=False, markup=False)

    with Progress(console=console) as progress, ThreadPoolExecutor(len(checkouts)) as pool:
        list(progress.track(pool.map(attempt, drawn, places), len(drawn), description=chapter))


def main() -> None:
    """Read the arguments, do it, and print a table."""
    signal.signal(signal.SIGTERM, end)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("chapters", nargs="*", default=list(CHAPTERS), metavar="CHAPTER")
    parser.add_argument("--count", type=int, default=40, help="mutants of each chapter (40)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time (1)")
    given = parser.parse_args()
    table, known = Table("chapter", "mutants", *RESULTS, "score", box=MARKDOWN), Known(given)
    with tempfile.TemporaryDirectory() as folder:
        checkouts = [Checkout(Path(folder) / str(job)) for job in range(given.jobs)]
        for chapter in given.chapters:
            mutate(checkouts, chapter, known, given.count)
            results = [outcome.result for outcome in known.outcomes.values() if outcome.chapter == chapter]
            counts = [results.count(result) for result in RESULTS]
            table.add_row(
                chapter, str(len(results)), *map(str, counts), f"{sum(counts[:2]) / max(sum(counts[:3]), 1):.0%}"
            )
    Console().print(table)


if __name__ == "__main__":
    main()
