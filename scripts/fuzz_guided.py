#!/usr/bin/env python3
"""Let atheris look for files that take a reader where no other did: coverage of Python decides what is damaged next.

    pip install atheris                        # Linux, for some versions of Python; no part of any extra
    scripts/fuzz_guided.py ply-mesh --seconds 60
    scripts/fuzz_guided.py tiff --seconds 600 --keep found/

It begins with the whole files of `damaged.py`, and stops at the first exception that is none of ours, at a crash, a
file that takes more than 10 s, or 4 GB of memory. `fuzz.py` looks for what coverage of Python does not see, and alone
for damaged Zarr, of which a file is one of many.
"""

import argparse
import contextlib
import inspect
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
for folder in (ROOT, ROOT / "scripts"):
    sys.path.insert(0, str(folder))

import atheris  # noqa: E402
from damaged import READERS  # noqa: E402

from o3dleaf.core.errors import O3DLeafError  # noqa: E402

SECONDS, MEGABYTES = 10, 4096
MAX_BYTES = 20_000
"""Bytes of a file."""

WATCHED = (
    "o3dleaf.io.ply_reader", "o3dleaf.io.polygons", "o3dleaf.io.obj", "o3dleaf.io.stl", "o3dleaf.io.clouds",
    "o3dleaf.io.models", "o3dleaf.leaf.saved", "o3dleaf.leaf.ct", "tifffile.tifffile", "laspy.header", "laspy.vlrs",
)  # fmt: skip
"""Modules whose branches are counted: those that look into files."""


def watch():
    """Have the functions and methods of readers counted; compiled loops stay as they are."""
    for name, module in list(sys.modules.items()):
        if name.startswith(WATCHED) and not name.endswith("_loops"):
            owners = [module, *(each for each in vars(module).values() if inspect.isclass(each))]
            for owner in owners:
                if getattr(owner, "__module__", name) == name:
                    for each in list(vars(owner).values()):
                        function = getattr(each, "__func__", each)
                        if inspect.isfunction(function) and function.__module__ == name:
                            atheris.instrument_func(function)


def main():
    """Begin with whole files, and go on until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reader", choices=[name for name in READERS if name != "zarr"])
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--keep", type=Path, default=Path(), help="folder for the file that was found")
    given = parser.parse_args()
    reader = READERS[given.reader]
    with tempfile.TemporaryDirectory(prefix="o3dleaf-fuzz-") as home:
        whole, corpus, place = Path(home) / "whole", Path(home) / "corpus", Path(home) / "place"
        for folder in (whole, corpus, place):
            folder.mkdir()
        reader.make(whole)
        for file in whole.glob("*.raw"):  # what damaged files lie beside
            shutil.copy(file, place)
        files = [file for file in whole.iterdir() if file.suffix != ".raw"]
        for file in files:  # loads what is loaded once
            with contextlib.suppress(O3DLeafError):
                reader.read(file)
        watch()
        # The first byte of a case says which suffix it gets.
        suffixes = sorted({"".join(file.suffixes[-2:]) for file in files})
        for file in files:
            number = suffixes.index("".join(file.suffixes[-2:]))
            (corpus / file.name).write_bytes(bytes([number]) + file.read_bytes())

        def read_one(data):
            if len(data) < 2:
                return
            file = place / f"a{suffixes[data[0] % len(suffixes)]}"
            file.write_bytes(data[1:])
            with contextlib.suppress(O3DLeafError):
                reader.read(file)

        options = [f"-max_total_time={given.seconds}", f"-timeout={SECONDS}", f"-rss_limit_mb={MEGABYTES}"]
        options += [f"-max_len={MAX_BYTES}", f"-artifact_prefix={given.keep}/"]
        atheris.Setup([sys.argv[0], *options, str(corpus)], read_one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
