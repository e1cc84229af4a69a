"""The program `o3dleaf`: the command line, under a guard that an interrupt meets from the first import on."""

import io
import os
import signal
import sys

# Until `main` nobody handles an interrupt: what takes milliseconds to import, `typing` and `re`, comes later, or never.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import NoReturn

SIGNALS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
"""Ctrl-C, and what schedulers send; the exit code is 128 and the number of the signal."""
LIBRARY = r"lib[\w.+-]+\.so(\.\d+)*"
PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libOpenGL.so.0": "libopengl0",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
    "libidn2.so.0": "libidn2-0",
    "libudev.so.1": "libudev1",
    "libusb-1.0.so.0": "libusb-1.0-0",
}
"""Of Debian, what Open3D and pymeshlab load from the system."""


def main() -> None:
    """Run the command line; an interrupt is one line and exit code 130 or 143, whatever it becomes on its way here.

    While modules are imported that may be another exception: compiled ones turn it into an ImportError. What the
    machine refuses, a library that is not there or a terminal that takes no more, is one line and exit code 2.
    """
    received: signal.Signals | None = None

    def interrupt(number: int, frame: "FrameType | None") -> None:
        nonlocal received
        received = signal.Signals(number)
        signal.default_int_handler(number, frame)

    # Whoever had it ignored, as a shell has in the background, has his reasons.
    for each in SIGNALS:
        if signal.getsignal(each) in {signal.default_int_handler, signal.SIG_DFL}:
            signal.signal(each, interrupt)
    # Into a file or a pipe Windows writes an older encoding, which lacks ρ and much that file names have.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        from o3dleaf.core.processes.light_imports import import_lightly  # noqa: PLC0415 - under the guard
        from o3dleaf.core.resources.machine import spare_addresses  # noqa: PLC0415

        spare_addresses()
        import_lightly()
        from o3dleaf.commands.cli import main as run_command_line  # noqa: PLC0415 - under the guard

        run_command_line()
    except BaseException as end:
        if received is None or (isinstance(end, SystemExit) and not end.code):
            _be_deaf()  # what was asked for is done; at the interpreter's end nobody can handle an interrupt
            line = _refusal(end)
            if line is None:
                if isinstance(end, SystemExit) and isinstance(end.code, int | None):
                    _leave(end.code or 0)
                raise
            _end(line, 2)
        _end(f"{SIGNALS[received]}; {_left_behind()}", 128 + received)
    _be_deaf()


def _left_behind() -> str:
    """Return what an interrupt leaves: nothing, but for the finished parts that were asked for."""
    parts = sys.modules.get("o3dleaf.core.resume.parts")  # whoever did not get there keeps none
    left_behind: Callable[[], list[str]] = getattr(parts, "left_behind", list)
    kept = left_behind()
    if not kept:
        return "a file that was not finished has left nothing behind"
    return f"what was finished is in {', '.join(kept)}; the same command with --resume goes on from it"


def _be_deaf() -> None:
    """Take no notice of signals any more."""
    for each in SIGNALS:
        if callable(signal.getsignal(each)):
            signal.signal(each, signal.SIG_IGN)


def _leave(code: int) -> None:
    """End at once: to take down Open3D, Numba and all they hold would take half a second more.

    Where what was printed cannot be delivered, return: the interpreter says so in its own way.
    """
    import atexit  # noqa: PLC0415 - see above

    try:
        atexit._run_exitfuncs()  # noqa: SLF001 - what the interpreter calls then; it has no other name
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except Exception:  # noqa: BLE001 - whatever it is, the interpreter meets it again
        return
    os._exit(code)


def _refusal(end: BaseException) -> str | None:
    """Return the line for what the machine refuses, or None."""
    import re  # noqa: PLC0415 - see above

    if isinstance(end, ImportError) and (found := re.search(LIBRARY, str(end))):
        package = PACKAGES.get(found[0], "")
        how = f", on Debian: apt-get install {package}" if package else ""
        return f"error: the system library {found[0]} is missing ({end}); install it{how}"
    if isinstance(end, OSError):
        return f"error: {end}; see that the place is there, can be written to and has space"
    return None


def _end(line: str, code: int) -> "NoReturn":
    """Write a line, if anybody listens, and end at once: at the interpreter's own end half imports spoil exit codes."""
    try:
        sys.stderr.write(f"o3dleaf: {' '.join(line.split())}\n")
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        pass
    os._exit(code)


if __name__ == "__main__":
    main()
