"""Mutation testing: change one place of the code at random, and see whether a test of its chapter notices.

python scripts/mutate.py [CHAPTER ...] [--count N] [--seed S] [--json FILE]

Chapters are those below, or any folder of the package; without one, all of these. The tests are those of the same
folder (tests/fitting/rbf for fitting/rbf), and of the same part of the story (tests/fitting) those that speak of the
changed file; what is named after it comes first, and the first that fails ends them. It is done in a copy of the
checkout, whose compiled code is kept apart for every mutant: nothing that a mutant compiled is ever loaded again.

A mutant is killed if a test fails, or if the tests take longer than three times what they take without it, and some
for compiling. What survives is printed with its place, to be looked at: some changes change nothing (equivalent
mutants), some only how fast a result is reached, and some show what no test holds.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
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

COMPILING = 240.0
"""Seconds that a mutant has for compiling what depends on it."""
PATIENCE = 3.0
"""Times that its tests may take of what they take without a mutant."""


RESULTS = ("killed", "ran past the limit", "survived")


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant, one of `RESULTS`."""

    chapter: str
    mutant: Mutant
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
        """Return the test files for some folders: what speaks of a mutant first, in the same part; their own."""
        own = [self.root / "tests" / folder for folder in folders]
        parts = {self.root / "tests" / Path(folder).parts[0] for folder in folders}
        files = [file for part in sorted(parts) for file in sorted(part.rglob("test_*.py"))]

        def nearness(file: Path) -> tuple[bool, ...]:
            at_home = any(file.is_relative_to(folder) for folder in own)
            if mutant is None:
                return (at_home,)
            text, stem = file.read_text(), mutant.path.stem.removesuffix("_loops")
            name = mutant.scope.rpartition(".")[2]
            return at_home and stem in file.stem, at_home and bool(name) and name in text, stem in text, at_home

        near = [file for file in sorted(files, key=nearness, reverse=True) if any(nearness(file))]
        return [str(file.relative_to(self.root)) for file in near]

    def run(self, tests: list[str], limit: float | None) -> bool | None:
        """Return whether the tests pass; None if they do not end within `limit` seconds."""
        shutil.rmtree(self.compiled, ignore_errors=True)
        kept = {"PYTHONPATH": str(self.root), "NUMBA_CACHE_DIR": str(self.compiled), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        process = subprocess.Popen(
            command,
            cwd=self.root,
            env={**os.environ, **kept},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return process.wait(limit) == 0
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def outcome(self, chapter: str, folders: tuple[str, ...], mutant: Mutant, limit: float) -> Outcome:
        """Return what becomes of a mutant."""
        original, start = mutant.path.read_bytes(), time.perf_counter()
        mutant.path.write_bytes(mutant.source())
        try:
            passed = self.run(self.tests(folders, mutant), limit)
        finally:
            mutant.path.write_bytes(original)
        result = RESULTS[1 if passed is None else 2 * passed]
        return Outcome(chapter, mutant, result, time.perf_counter() - start)


def mutate(checkout: Checkout, chapter: str, folders: tuple[str, ...], count: int, seed: int) -> list[Outcome]:
    """Return the outcome of `count` random mutants of a chapter, with progress."""
    start = time.perf_counter()
    if not checkout.run(checkout.tests(folders), None):
        sys.exit(f"{chapter}: its tests fail without any mutant; mend them first")
    limit = PATIENCE * (time.perf_counter() - start) + COMPILING
    known = checkout.mutants(folders)
    random.Random(seed).shuffle(known)
    outcomes = []
    with Progress(console=Console(stderr=True)) as progress:
        for mutant in progress.track(known[:count], description=chapter):
            outcomes.append(checkout.outcome(chapter, folders, mutant, limit))
            if outcomes[-1].result == "survived":
                progress.console.print(place(checkout, mutant), highlight=False, markup=False)
    return outcomes


def place(checkout: Checkout, mutant: Mutant) -> str:
    """Return where a mutant is and what it changes."""
    return f"{mutant.path.relative_to(checkout.root)}:{mutant.line}: {mutant.change()}"


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
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        checkout = Checkout(Path(folder))
        for chapter in given.chapters:
            made = mutate(checkout, chapter, CHAPTERS.get(chapter, (chapter,)), given.count, given.seed)
            counts = [
                sum(each.result == word for each in made) for word in ("killed", "ran past the limit", "survived")
            ]
            table.add_row(chapter, str(len(made)), *map(str, counts), f"{1 - counts[-1] / len(made):.0%}")
            outcomes += made
        rows = [
            {"chapter": each.chapter, "place": place(checkout, each.mutant), "result": each.result, "s": each.seconds}
            for each in outcomes
        ]
    Console().print(table)
    if given.json:
        write_json({"seed": given.seed, "mutants": rows}, given.json)


if __name__ == "__main__":
    main()
