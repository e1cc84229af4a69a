"""Surface Evolver at work on a static drop."""

import shutil
import subprocess
import tempfile
from os import PathLike
from pathlib import Path

from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.output.static_drop.datafile import StaticDrop
from o3dleaf.output.static_drop.shape import DropShape

SUFFIX = ".fe"
PROGRAM = "evolver"
WHERE = "install it with apt-get install evolver-nox"
TOUCHES = 0.005
"""Of the radius: deeper than this below the surface, more than curved triangles err by, a drop goes through it."""
SECONDS = 120.0
"""After which a run is given up: usual are two to ten."""


def write_drop(drop: StaticDrop, path: str | PathLike[str]) -> None:
    """Write the data file of a drop; it appears whole or not at all."""
    with whole_file(require_writable(path, (SUFFIX,))) as temporary:
        temporary.write_text(drop.text(), encoding="ascii", errors="replace", newline="\n")


def has_evolver() -> bool:
    """Return whether Surface Evolver is here."""
    return shutil.which(PROGRAM) is not None


def settle_drop(drop: StaticDrop, *, timeout: float = SECONDS) -> DropShape:
    """Let Surface Evolver bring a drop to rest, and return its shape.

    Raises
    ------
    InputError
        If Surface Evolver is not here.
    O3DLeafError
        If the drop does not come to rest, or not in `timeout` seconds, or comes to touch the surface elsewhere.
    """
    if not has_evolver():
        raise InputError(f"evolver: Surface Evolver is not here; {WHERE}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_drop(drop, folder / "drop.fe")
        (folder / "commands").write_text("settle\nsay\nq\nq\n", encoding="ascii")
        call = [PROGRAM, "-f", "commands", "drop.fe"]
        try:
            done = subprocess.run(  # noqa: S603  the program is named above, the files are ours
                call, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=timeout, check=False
            )
        except subprocess.TimeoutExpired:
            raise O3DLeafError(
                f"evolver: is not done after {timeout:g} s; give it more, or a simpler surface"
            ) from None
    shape = DropShape.read(drop, done.stdout)
    if shape.clearance < -TOUCHES * drop.radius:
        raise O3DLeafError(
            "evolver: the drop touches the surface a second time beside its line of contact; choose another place, a "
            "smaller angle or a smaller drop"
        )
    return shape
