#!/usr/bin/env python3
"""Damage small files of every format that is read, read them, and count what should not be.

    scripts/fuzz.py                            # 10 million bytes a reader
    scripts/fuzz.py pcd obj --megabytes 1 --seed 7
    scripts/fuzz.py --show obj 12345           # one case again, here

A case is damaged by its number alone, so that it can be shown again. Readers run in a child process. What counts as
found: the process dies (crash), a case takes more than 10 s (hang) or more memory than 64 MiB and 100 bytes a byte of
the file (memory), an exception comes that is none of ours (exception), or the same file read twice, with other
remains in fresh memory, gives other numbers (wild). Damaged files that were found are kept in the folder --keep.
"""

import argparse
import collections
import ctypes
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
for folder in (ROOT, ROOT / "scripts"):
    sys.path.insert(0, str(folder))

from damaged import MAX_EDITS, READERS  # noqa: E402

SECONDS = 10
SPARE, TIMES = 64 << 20, 100
"""Bytes of memory that a file may take, and that each byte of it may."""
CEILING = 2 << 30
"""Bytes above what the process has before the first case, where an allocation fails, so that this machine lives."""
MAX_DEATHS = 40
"""Of a reader; each new process takes seconds."""
PERTURB = -6
"""M_PERTURB of glibc's mallopt: what fresh memory is filled with."""


def edits_of(number, count):
    """Return which file of `count`, which other one, and which edits, a case has."""
    rng = np.random.default_rng(number)
    first, other = (int(each) for each in rng.integers(count, size=2))
    rows = rng.integers(1 << 32, size=(rng.integers(1, MAX_EDITS + 1), 3))
    return first, other, [tuple(int(each) for each in row) for row in rows]


def case_of(reader, corpus, number):
    """Return the name and the content of a case."""
    first, other, edits = edits_of(number, len(corpus))
    return corpus[first][0], reader.damage(corpus[first][1], edits, corpus[other][1])


def corpus_of(folder, reader):
    """Return the whole files of a reader, made once."""
    if not folder.exists():
        folder.mkdir(parents=True)
        reader.make(folder)
    return [(file.name, file.read_bytes()) for file in sorted(folder.iterdir()) if file.suffix != ".raw"]


def peak():
    """Return the most memory that was used since `forget_peak`."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def forget_peak():
    """Begin to watch memory anew."""
    Path("/proc/self/clear_refs").write_text("5")


def outcome_of(reader, file, fill):
    """Return what became of a file: "read" with its numbers, "refused", or what was found, and where.

    What took much memory is tried again: pages that the system had taken away meanwhile count as taken anew.
    """
    kind, where = tried(reader, file, fill)
    return tried(reader, file, fill) if kind == "memory" else (kind, where)


def tried(reader, file, fill):
    """Return the outcome of one trial."""
    from o3dleaf.core.errors import O3DLeafError  # noqa: PLC0415 - heavy

    forget_peak()
    before = peak()
    try:
        fill(0xAA)
        arrays = reader.read(file)
        fill(0x55)
        again = reader.read(file)
    except O3DLeafError as error:
        kind, where = "refused", ""
        if "\n" in str(error):
            kind, where = "exception", "a message of several lines"
    except MemoryError as error:
        kind, where = "memory", place_of(error)
    except Exception as error:  # noqa: BLE001 - they are what is looked for
        kind, where = "exception", place_of(error)
    else:
        same = len(arrays) == len(again) and all(a.tobytes() == b.tobytes() for a, b in zip(arrays, again, strict=True))
        kind, where = ("read", "") if same else ("wild", "")
    taken = peak() - before
    if kind in {"read", "refused"} and taken > SPARE + TIMES * file.stat().st_size:
        kind, where = "memory", f"{taken >> 20} MiB"
    return kind, where


def place_of(error):
    """Return an exception with the last line of ours that it went through."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "/o3dleaf/" in frame.filename]
    where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
    return f"{type(error).__name__} at {where}"


def work(name, home, start, stop, size):
    """Run cases from `start` until `size` bytes, a line before and one behind each, in this process."""
    out = os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    reader = READERS[name]
    corpus = corpus_of(home / name, reader)
    folder = Path(tempfile.mkdtemp(dir=home))
    for file in (home / name).glob("*.raw"):  # what damaged files lie beside
        (folder / file.name).write_bytes(file.read_bytes())
    for file, content in corpus:  # loads what is loaded once
        (folder / file).write_bytes(content)
        outcome_of(reader, folder / file, lambda _: None)
    library = ctypes.CDLL(None)
    limit = 1024 * int(Path("/proc/self/status").read_text().split("VmSize:")[1].split()[0]) + CEILING
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    done = 0
    for number in range(start, stop):
        file, content = case_of(reader, corpus, number)
        (folder / file).write_bytes(content)
        out.write(f"begin {number} {len(content)}\n".encode())
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        kind, where = (
            outcome_of(reader, folder / file, lambda byte: library.mallopt(PERTURB, byte))
            if content
            else ("refused", "")
        )
        signal.setitimer(signal.ITIMER_REAL, 0)
        out.write(f"end {number} {kind} {where}\n".encode())
        done += len(content)
        if done >= size:
            break


def fuzz(name, size, seed, home, keep):
    """Run one reader in child processes, until `size` bytes, and return what was counted."""
    counts, found, done, cases = collections.Counter(), {}, 0, 0
    number, began, deaths = seed << 32, time.monotonic(), 0
    while done < size and deaths < MAX_DEATHS:
        command = [sys.executable, __file__, "--work", name, home, str(number), str(size - done)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
            open_case = None
            for line in child.stdout:
                what, at, rest = line.decode().rstrip("\n").split(" ", 2)
                number = int(at) + 1
                if what == "begin":
                    open_case, length = int(at), int(rest)
                    done, cases = done + length, cases + 1
                    continue
                open_case = None
                kind, where = rest.split(" ", 1)
                note(name, int(at), kind, where, counts=counts, found=found, home=home, keep=keep)
        if open_case is not None:
            deaths += 1
            signal_name = signal.Signals(-child.returncode).name if child.returncode < 0 else str(child.returncode)
            kind = "hang" if signal_name == "SIGALRM" else "crash"
            note(name, open_case, kind, signal_name, counts=counts, found=found, home=home, keep=keep)
        elif child.returncode:
            raise SystemExit(f"{name}: the child ended with {child.returncode} between two cases")
    return {
        "reader": name, "bytes": done, "cases": cases, "seconds": round(time.monotonic() - began), **counts,
        "found": found,
    }  # fmt: skip


def note(name, number, kind, where, *, counts, found, home, keep):
    """Count a case, and keep it if it is a new kind of find."""
    counts[kind] += 1
    key = f"{kind} {where}"
    if kind in {"read", "refused"}:
        return
    if key not in found:
        found[key] = []
        if keep:
            reader = READERS[name]
            file, content = case_of(reader, corpus_of(Path(home) / name, reader), number)
            (keep / f"{kind}-{name}-{number}-{file}").write_bytes(content)
    if len(found[key]) < 5:
        found[key].append(number)


def main():
    """Fuzz, and print a table."""
    if sys.argv[1:2] == ["--work"]:
        name, home, start, size = sys.argv[2:]
        work(name, Path(home), int(start), int(start) + 10**9, int(size))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("readers", nargs="*", choices=[*READERS, []], help="by default all")
    parser.add_argument("--megabytes", type=float, default=10.0, help="of damaged files a reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for files that were found")
    parser.add_argument("--json", type=Path, help="what was counted, as JSON")
    parser.add_argument("--show", nargs=2, metavar=("READER", "CASE"), help="read one case here")
    given = parser.parse_args()
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="o3dleaf-fuzz-") as home:
        if given.show:
            reader = READERS[given.show[0]]
            file, content = case_of(reader, corpus_of(Path(home) / given.show[0], reader), int(given.show[1]))
            for whole in (Path(home) / given.show[0]).glob("*.raw"):
                (Path(home) / whole.name).write_bytes(whole.read_bytes())
            (Path(home) / file).write_bytes(content)
            print(file, content[:2000])
            print([array.shape for array in reader.read(Path(home) / file)])
            return
        rows = []
        for name in given.readers or READERS:
            row = fuzz(name, int(given.megabytes * 1e6), given.seed, home, given.keep)
            rows.append(row)
            print(json.dumps(row), flush=True)
            if given.json:
                given.json.write_text(json.dumps(rows, indent=1))
    sys.exit(any(row["found"] for row in rows))


if __name__ == "__main__":
    main()
