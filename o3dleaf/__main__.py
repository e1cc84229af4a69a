"""The program `o3dleaf`: the command line, under a guard that an interrupt meets from the first import on."""

import io
import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130
"""Exit code of a program that Ctrl-C ended: 128 and the number of the signal."""


def main() -> None:
    """Run the command line; an interrupt is one line and exit code 130, whatever it becomes on its way here.

    While modules are imported that may be another exception: compiled ones turn it into an ImportError.
    """
    interrupted = False
    # Into a file or a pipe Windows writes an older encoding, which lacks ρ and much that file names have.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        signal.default_int_handler(number, frame)

    # Whoever had it ignored, as a shell has in the background, has his reasons.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        from o3dleaf.commands.cli import main as run_command_line  # noqa: PLC0415 - under the guard

        run_command_line()
    except BaseException as end:
        if not interrupted or (isinstance(end, SystemExit) and not end.code):
            raise
        sys.stderr.write("o3dleaf: interrupted; a file that was not finished has left nothing behind\n")
        sys.stderr.flush()
        # At once: at the interpreter's own end modules that are half imported may spoil the exit code.
        os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
