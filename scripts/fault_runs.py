#!/usr/bin/env python3
"""End commands at many moments, and look at what they leave.

    scripts/fault_runs.py                      # all faults, all jobs
    scripts/fault_runs.py kill --moments 10 --jobs fit report

kill       SIGKILL: a final name holds a whole file or nothing; what is left over goes with the next run
interrupt  SIGINT: exit code 130 within a second of processor time, one line, nothing left over; the first milliseconds,
           in which the interpreter starts and the program does not listen yet, are told apart
terminate  SIGTERM: the same with 143
full       a disk of 64 KiB to 4 MiB (a tmpfs, where it may be mounted, else the largest size of a file): one line, exit
           code 2, nothing left over
both       two runs on one output at once: the file is whole
vanish     the input is removed or emptied while it is read: a whole file, or one line

Jobs: fit (`patch`), extraction (`reconstruct`), streaming (`leaf`), report (`qa --html`). Each is run whole first; what
it writes then is what whole means.
"""

import argparse
import collections
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = [sys.executable, "-m", "o3dleaf"]
SECONDS = 1.0
"""In which an interrupted run has to end."""
STARTING = 0.15
"""Share of moments that fall into the first half second, while modules are imported."""
DISKS = (1 << 16, 1 << 18, 1 << 20, 1 << 22)
CALM = {"OMP_NUM_THREADS": "2"}


def prepare(home):
    """Write inputs, and return the jobs: arguments, and the files that they write, by name."""
    sys.path.insert(0, str(ROOT))
    import open3d as o3d  # noqa: PLC0415 - heavy

    from o3dleaf.io.triangle_mesh import write_mesh  # noqa: PLC0415 - heavy
    from o3dleaf.samples import Torus  # noqa: PLC0415 - heavy
    from o3dleaf.samples.files import write_samples  # noqa: PLC0415 - heavy

    write_samples(home / "samples")
    points, _ = Torus().sample(4_000, seed=0)
    o3d.io.write_point_cloud(home / "torus.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    mesh = o3d.geometry.TriangleMesh.create_torus(radial_resolution=40, tubular_resolution=20)
    write_mesh(mesh, home / "torus_mesh.ply")
    samples = home / "samples"
    return {
        "fit": (["patch", samples / "wheat_ct_24um.tif", "-o", "out.o3l"], ["out.o3l"]),
        "extraction": (
            ["reconstruct", home / "torus.ply", "-o", "out.ply", "--model", "out.o3l"],
            ["out.ply", "out.o3l"],
        ),
        "streaming": (
            [
                "leaf", samples / "wheat_scan.ply", "--ct", samples / "wheat_ct_24um.tif", "--midrib",
                samples / "wheat_midrib.ply", "--spacing", "0.4", "-o", "out.ply", "--model", "out.o3l",
            ],
            ["out.ply", "out.o3l", "out.json", "out.png"],
        ),
        "report": (
            ["qa", home / "torus_mesh.ply", "--html", "out.html", "--json", "out.json"],
            ["out.html", "out.json"],
        ),
    }  # fmt: skip


def start(arguments, folder, **more):
    """Start a command in a folder."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | CALM | {"PYTHONPATH": path}
    return subprocess.Popen(
        [*PROGRAM, *map(str, arguments)], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL, text=True, errors="replace", **more,
    )  # fmt: skip


def sums(folder, names):
    """Return the hash of each file that is there."""
    files = [folder / name for name in names]
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest()[:16] for file in files if file.is_file()}


def left_over(folder, names):
    """Return what is in a folder beside the files of a job."""
    return sorted(path.name for path in folder.iterdir() if path.name not in names)


def fresh(home):
    """Return an empty folder."""
    return Path(tempfile.mkdtemp(dir=home))


def whole_run(job, home):
    """Run a job twice, and return its time and the hashes of its files; None for those that differ."""
    arguments, names = job
    found = []
    for _ in range(2):
        folder, began = fresh(home), time.monotonic()
        run = start(arguments, folder)
        _, said = run.communicate()
        if run.returncode:
            raise SystemExit(f"{arguments[0]}: exit code {run.returncode}: {said}")
        took = time.monotonic() - began
        found.append(sums(folder, names))
        shutil.rmtree(folder)
    return took, {name: each if found[1][name] == each else None for name, each in found[0].items()}


def moments(count, took, rng):
    """Return seconds from the first millisecond to the end."""
    early = max(1, round(STARTING * count))
    return sorted([0.001, *rng.uniform(0.001, 0.5, early - 1), *rng.uniform(0.0, took, count - early)])


def is_whole(file, expected):
    """Return whether a file is what a whole run writes: the same bytes, or, where runs differ, a whole HTML or JSON."""
    if expected is not None:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:16] == expected
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        json.loads(text)
        return True
    return text.rstrip().endswith("</html>")


def require_whole(folder, expected, faults, where):
    """Note files that are there and not whole."""
    for name, each in expected.items():
        if (folder / name).exists() and not is_whole(folder / name, each):
            faults.append(f"{where}: {name} is not whole")


def killed(name, job, count, home):
    """Kill a job at `count` moments."""
    arguments, names = job
    took, expected = whole_run(job, home)
    faults, outcomes, folder = [], collections.Counter(), fresh(home)
    for moment in moments(count, took, np.random.default_rng(1)):
        run = start(arguments, folder)
        time.sleep(moment)
        run.kill()
        run.communicate()
        outcomes["ended before" if run.returncode == 0 else "killed"] += 1
        require_whole(folder, expected, faults, f"{moment:.3f} s")
        outcomes["left a temporary file"] += len(left_over(folder, names)) > 0
        for file in names:
            (folder / file).unlink(missing_ok=True)
    run = start(arguments, folder)
    _, said = run.communicate()
    if run.returncode or left_over(folder, names):
        faults.append(f"the next run: exit code {run.returncode}, left {left_over(folder, names)}: {said[-200:]}")
    return {"fault": "kill", "job": name, "seconds": round(took, 1), **outcomes, "wrong": faults}


def stopped(name, job, count, home, *, number):
    """Send a signal to a job at `count` moments."""
    took, expected = whole_run(job, home)
    faults, outcomes, longest, busiest = [], collections.Counter(), 0.0, 0.0
    for moment in moments(count, took, np.random.default_rng(2)):
        folder = fresh(home)
        code, words, wall, busy, listened = send(job[0], folder, moment, number)
        faults += [f"{moment:.3f} s: {fault}" for fault in wrong_with(code, words, number, listened=listened)]
        if code == 0:
            outcomes["ended before"] += 1
        else:
            outcomes[f"exit code {code}" if code > 1 else "died of it, before the program listens"] += 1
            longest, busiest = max(longest, wall), max(busiest, busy)
            if busy > SECONDS:
                faults.append(f"{moment:.3f} s: ended after {busy:.2f} s of processor time, {wall:.2f} s")
        require_whole(folder, expected, faults, f"{moment:.3f} s")
        if left_over(folder, job[1]):
            faults.append(f"{moment:.3f} s: left {left_over(folder, job[1])}")
        shutil.rmtree(folder)
    word = signal.Signals(number).name
    times = {"longest": round(longest, 2), "processor": round(busiest, 2), "load": round(os.getloadavg()[0], 1)}
    return {"fault": word, "job": name, "seconds": round(took, 1), **times, **outcomes, "wrong": faults}


def send(arguments, folder, moment, number):
    """Run a job, send it a signal, and return its exit code, its words, the time from then on, and if it listened."""
    spent = children_seconds()
    run = start(arguments, folder)
    time.sleep(moment)
    listened, used = listening(run.pid), processor_seconds(run.pid)
    sent = time.monotonic()
    run.send_signal(number)
    out, said = run.communicate()
    return run.returncode, said + out, time.monotonic() - sent, children_seconds() - spent - used, listened


def wrong_with(code, words, number, *, listened):
    """Yield what a run that got a signal did wrong: its code, a traceback, several lines, death though it listened."""
    if not listened and code in {1, -number} and "o3dleaf" not in words:
        return  # the interpreter's own end, of which Ctrl-C is a traceback
    if code not in {0, 128 + number, -number}:
        yield f"exit code {code}: {words[-300:]!r}"
    if code == -number and listened:
        yield "died of it, though it listened"
    lines = [line for line in words.replace("\r", "\n").splitlines() if line.startswith("o3dleaf: ")]
    if code != -number and ("Traceback" in words or "Exception ignored" in words):
        yield f"a traceback: {words[-600:]!r}"
    elif code > 0 and len(lines) != 1:
        yield f"{len(lines)} lines: {words[-300:]!r}"


def listening(process):
    """Return whether a process has a handler for SIGTERM: it is the program's, Python has none."""
    caught = Path(f"/proc/{process}/status").read_text().split("SigCgt:")[1].split()[0]
    return bool(int(caught, 16) >> signal.SIGTERM - 1 & 1)


def processor_seconds(process):
    """Return the processor time that a process has taken."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children_seconds():
    """Return the processor time of all processes that were waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def on_full_disk(name, job, count, home):
    """Run a job where the disk is full."""
    del count
    arguments, names = job
    _, expected = whole_run(job, home)
    faults, outcomes = [], collections.Counter()
    for size in DISKS:
        folder = fresh(home)
        mounted = not subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=False, capture_output=True
        ).returncode
        limit = None if mounted else (lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
        run = start(arguments, folder, preexec_fn=limit)
        out, said = run.communicate()
        outcomes["tmpfs" if mounted else "limit of a file"] += 1
        outcomes[f"exit code {run.returncode}"] += 1
        lines = [line for line in said.splitlines() if "error:" in line]
        if run.returncode not in {0, 2} or "Traceback" in said + out:
            faults.append(f"{size >> 10} KiB: exit code {run.returncode}: {said[-500:]!r}")
        elif run.returncode == 2 and len(lines) != 1:
            faults.append(f"{size >> 10} KiB: {said[-300:]!r}")
        require_whole(folder, expected, faults, f"{size >> 10} KiB")
        if left_over(folder, names):
            faults.append(f"{size >> 10} KiB: left {left_over(folder, names)}")
        if mounted:
            subprocess.run(["umount", folder], check=True)
    return {"fault": "full", "job": name, **outcomes, "wrong": faults}


def two_at_once(name, job, count, home):
    """Run a job twice at once, with one output."""
    arguments, names = job
    _, expected = whole_run(job, home)
    faults, outcomes = [], collections.Counter()
    for _ in range(max(1, count // 10)):
        folder = fresh(home)
        runs = [start(arguments, folder) for _ in range(2)]
        for run in runs:
            _, said = run.communicate()
            outcomes[f"exit code {run.returncode}"] += 1
            if run.returncode:
                faults.append(f"exit code {run.returncode}: {said[-300:]!r}")
        require_whole(folder, expected, faults, "together")
        if sorted(sums(folder, names)) != sorted(names) or left_over(folder, names):
            faults.append(f"wrote {sorted(sums(folder, names))}, left {left_over(folder, names)}")
    return {"fault": "both", "job": name, **outcomes, "wrong": faults}


def vanished(name, job, count, home):
    """Remove the inputs of a job, or empty them, while it runs."""
    arguments, names = job
    took, expected = whole_run(job, home)
    faults, outcomes = [], collections.Counter()
    for moment in moments(max(2, count // 3), took, np.random.default_rng(3)):
        for spoil in (Path.unlink, lambda file: os.truncate(file, file.stat().st_size // 2)):
            folder, copies = fresh(home), fresh(home)
            given = [shutil.copy(each, copies / each.name) if isinstance(each, Path) else each for each in arguments]
            run = start(given, folder)
            time.sleep(moment)
            for file in copies.iterdir():
                spoil(file)
            out, said = run.communicate()
            outcomes[f"exit code {run.returncode}"] += 1
            if run.returncode not in {0, 2} or "Traceback" in said + out:
                faults.append(f"{moment:.3f} s: exit code {run.returncode}: {said[-500:]!r}")
            if run.returncode != 0:
                require_whole(folder, {each: expected[each] for each in names}, faults, f"{moment:.3f} s")
            if left_over(folder, names):
                faults.append(f"{moment:.3f} s: left {left_over(folder, names)}")
            shutil.rmtree(folder)
            shutil.rmtree(copies)
    return {"fault": "vanish", "job": name, **outcomes, "wrong": faults}


FAULTS = {
    "kill": killed,
    "interrupt": lambda *given: stopped(*given, number=signal.SIGINT),
    "terminate": lambda *given: stopped(*given, number=signal.SIGTERM),
    "full": on_full_disk,
    "both": two_at_once,
    "vanish": vanished,
}


def main():
    """Run the faults, and print a line each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("faults", nargs="*", choices=[*FAULTS, []], help="by default all")
    parser.add_argument("--jobs", nargs="+", help="by default all")
    parser.add_argument("--moments", type=int, help="of each job; by default 50 kills and 20 signals")
    given = parser.parse_args()
    # A shell that starts this in the background has it ignore Ctrl-C, and its children, too: not so here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="o3dleaf-faults-") as folder:
        home = Path(folder)
        jobs = prepare(home)
        for fault in given.faults or FAULTS:
            for name in given.jobs or jobs:
                count = given.moments or (50 if fault == "kill" else 20)
                row = FAULTS[fault](name, jobs[name], count, home)
                print(json.dumps(row, ensure_ascii=False), flush=True)
                wrong += len(row["wrong"])
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
