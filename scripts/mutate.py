"""Mutation testing: change one place of the code at random, and see whether a test of its chapter notices.

python scripts/mutate.py [CHAPTER ...] [--count N] [--seed S] [--json FILE]

It takes hours. With --json, what is known is in the file after every mutant, and is not tried again by a later run.

Chapters are those below, or any folder of the package; without one, all of these. The tests are those of the same
folder (tests/fitting/rbf for fitting/rbf), and of the same part of the story (tests/fitting) those that speak of the
changed file; what is named after it comes first, and the first that fails ends them. It is done in a copy of the
checkout, whose compiled code is kept apart for every mutant: nothing that a mutant compiled is ever loaded again.

A mutant is killed if a test fails, or if the tests take more than twice the processor time that they take without it,
and some for compiling. What survives is printed with its place, to be looked at: some changes change nothing
(equivalent mutants), some only how fast a result is reached, and some show what no test holds.
"""

import argparse
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from mutants import Mutant, mutants_of
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

COMPILING = 120.0
"""Seconds of processor time that a mutant has for compiling what depends on it."""
PATIENCE = 2.0
"""Times that its tests may take of the processor time that they take without a mutant."""
WAITING = 10.0
"""Seconds that tests may take for one of processor time: what waits forever is ended too."""

RESULTS = ("killed", "ran past the limit", "survived")


@dataclass(frozen=True)
class Outcome:
    """What became of the change at a place, one of `RESULTS`, and the processor time of its tests."""

    chapter: str
    place: str
    result: str
    seconds: float


class Checkout:
    """A copy of the checkout in which one file at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "checkout"
        shutil.copytree(
            ROOT, self.root, symlinks=True, ignore=shutil.ignore_patterns(".git", ".*_cache", "__pycache__")
        )
        if (ROOT.parent / "shared").exists():  # real scans, which some tests read
            (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
        self.compiled = folder / "compiled"

    def mutants(self, folders: tuple[str, ...]) -> list[Mutant]:
        """Return all mutants of some folders."""
        files = [file for folder in folders for file in sorted((self.root / "o3dleaf" / folder).rglob("*.py"))]
        return [mutant for file in files if file.name != "__init__.py" for mutant in mutants_of(file)]

    def tests(self, folders: tuple[str, ...], mutant: Mutant | None = None) -> list[str]:
        """Return the test files for some folders: their own, and of the same part those that use a mutant's module.

        What speaks of the mutant comes first, then what imports its module, or a module that imports it.
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

        near = [file for file in sorted(files, key=nearness, reverse=True) if any(nearness(file))]
        return [str(file.relative_to(self.root)) for file in near]

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

    def run(self, tests: list[str], limit: float) -> tuple[bool | None, float]:
        """Return whether the tests pass, None beyond a limit of processor time, and what they took of it."""
        shutil.rmtree(self.compiled, ignore_errors=True)
        kept = {"PYTHONPATH": str(self.root), "NUMBA_CACHE_DIR": str(self.compiled), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        before = processor_time()
        process = subprocess.Popen(
            command,
            cwd=self.root,
            env={**os.environ, **kept},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (int(limit), int(limit)))
        try:
            status = process.wait(WAITING * limit)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        beyond = status in (None, -signal.SIGXCPU, -signal.SIGKILL)
        return None if beyond else status == 0, processor_time() - before

    def outcome(self, chapter: str, folders: tuple[str, ...], mutant: Mutant, limit: float) -> Outcome:
        """Return what becomes of a mutant."""
        where, original = place(self, mutant), mutant.path.read_bytes()
        mutant.path.write_bytes(mutant.source())
        try:
            passed, seconds = self.run(self.tests(folders, mutant), limit)
        finally:
            mutant.path.write_bytes(original)
        return Outcome(chapter, where, RESULTS[1 if passed is None else 2 * passed], round(seconds, 1))


def processor_time() -> float:
    """Return the processor time of all children that have ended, in seconds."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def place(checkout: Checkout, mutant: Mutant) -> str:
    """Return where a mutant is and what it changes."""
    return f"{mutant.path.relative_to(checkout.root)}:{mutant.line}: {mutant.change()}"


def mutate(checkout: Checkout, chapter: str, given: argparse.Namespace) -> list[Outcome]:
    """Return the outcome of random mutants of a chapter, with progress."""
    folders, console = CHAPTERS.get(chapter, (chapter,)), Console(stderr=True)
    drawn = checkout.mutants(folders)
    random.Random(given.seed).shuffle(drawn)
    known = {each.place: each for each in read(given.json) if each.chapter == chapter}
    passed, seconds = checkout.run(checkout.tests(folders), 3600.0)
    if not passed:
        sys.exit(f"{chapter}: its tests fail without any mutant; mend them first")
    outcomes = []
    with Progress(console=console) as progress:
        for mutant in progress.track(drawn[: given.count], description=chapter):
            outcome = known.get(place(checkout, mutant)) or checkout.outcome(
                chapter, folders, mutant, PATIENCE * seconds + COMPILING
            )
            outcomes.append(outcome)
            others = [each for each in read(given.json) if each != outcome]
            if given.json:
                write_json({"seed": given.seed, "mutants": [asdict(each) for each in [*others, outcome]]}, given.json)
            if outcome.result == "survived":
                console.print(outcome.place, highlight=False, markup=False)
    return outcomes


def read(file: Path | None) -> list[Outcome]:
    """Return what an earlier run wrote."""
    return [Outcome(**row) for row in json.loads(file.read_text())["mutants"]] if file and file.exists() else []


def main() -> None:
    """Read the arguments, do it, and print a table."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the tests of the moment end too
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("chapters", nargs="*", default=list(CHAPTERS), metavar="CHAPTER")
    parser.add_argument("--count", type=int, default=40, help="mutants of each chapter (40)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    table = Table("chapter", "mutants", *RESULTS, "score")
    with tempfile.TemporaryDirectory() as folder:
        checkout = Checkout(Path(folder))
        for chapter in given.chapters:
            results = [outcome.result for outcome in mutate(checkout, chapter, given)]
            counts = [results.count(result) for result in RESULTS]
            table.add_row(chapter, str(len(results)), *map(str, counts), f"{1 - counts[-1] / len(results):.0%}")
    Console().print(table)


if __name__ == "__main__":
    main()
