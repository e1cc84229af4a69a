"""The program `o3dleaf`: the command line, under a guard that an interrupt meets from the first import on."""

import io
import os
import signal
import sys
from types import FrameType

SIGNALS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
"""Ctrl-C, and what schedulers send; the exit code is 128 and the number of the signal."""


def main() -> None:
    """Run the command line; an interrupt is one line and exit code 130 or 143, whatever it becomes on its way here.

    While modules are imported that may be another exception: compiled ones turn it into an ImportError.
    """
    received: signal.Signals | None = None
    # Into a file or a pipe Windows writes an older encoding, which lacks ρ and much that file names have.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal received
        received = signal.Signals(number)
        signal.default_int_handler(number, frame)

    # Whoever had it ignored, as a shell has in the background, has his reasons.
    for each in SIGNALS:
        if signal.getsignal(each) in {signal.default_int_handler, signal.SIG_DFL}:
            signal.signal(each, interrupt)
    try:
        from o3dleaf.core.memory.machine import spare_addresses  # noqa: PLC0415 - under the guard

        spare_addresses()
        from o3dleaf.commands.cli import main as run_command_line  # noqa: PLC0415 - under the guard

        run_command_line()
    except BaseException as end:
        if received is None or (isinstance(end, SystemExit) and not end.code):
            raise
        sys.stderr.write(f"o3dleaf: {SIGNALS[received]}; a file that was not finished has left nothing behind\n")
        sys.stderr.flush()
        # At once: at the interpreter's own end modules that are half imported may spoil the exit code.
        os._exit(128 + received)


if __name__ == "__main__":
    main()
