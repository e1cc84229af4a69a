"""What the tests call of the compiled functions; a pytest plugin, which `conftest.py` names.

A function that is not listed (`o3dleaf/core/compiled/signatures.txt`) is compiled while a test waits for it.
"""

from pathlib import Path

import pytest

from o3dleaf.core.compiled import signatures

CALLED = pytest.StashKey[set[str]]()
"""The lines of a list."""

SHOWN = 10


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option of `scripts/list_compiled.py`."""
    parser.addoption(
        "--called", metavar="FILE", type=Path, help="write what was called of the compiled functions there"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Begin with nothing."""
    config.stash[CALLED] = set()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Take what this process called, and let a worker tell it."""
    session.config.stash[CALLED].update(signatures.called())
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["called"] = sorted(session.config.stash[CALLED])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    """Hear it."""
    node.config.stash[CALLED].update(getattr(node, "workeroutput", {}).get("called", ()))  # type: ignore[attr-defined]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Write it, or say what the tests called that is not listed; those marked slow are not meant to be."""
    called = config.stash[CALLED]
    if config.option.called is not None:
        config.option.called.write_text("\n".join((*sorted(called), "")), encoding="utf-8")
    elif not config.option.slow and (unlisted := sorted(called - set(signatures.listed("tests")))):
        terminalreporter.section("compiled functions that are called but not listed")
        for line in unlisted[:SHOWN]:
            terminalreporter.write_line(line)
        terminalreporter.write_line(f"{len(unlisted)} in all; scripts/list_compiled.py --write lists them")
