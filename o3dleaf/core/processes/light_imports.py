"""What a process of ours does without: modules that a library imports for functions which we never call."""

import sys
from types import ModuleType


def import_lightly() -> None:
    """Let libraries import empty modules instead of some: for processes that are ours, the command line's and children.

    What is loaded already stays.
    """
    _import_without_dash()
    _import_without_f2py()


def _import_without_dash() -> None:
    """Let Open3D do without Dash, the web server of `draw_plotly_server`: a third of a second less to start."""
    if "dash" not in sys.modules:
        empty = ModuleType("dash", "Left out by o3dleaf.")
        vars(empty).update(html=None, dcc=None, Dash=None)
        sys.modules["dash"] = empty


def _import_without_f2py() -> None:
    """Let SciPy, which imports all that NumPy names, do without its compiler of Fortran: a tenth of a second less."""
    import numpy as np  # noqa: PLC0415 - under the guard against interrupts

    if "numpy.f2py" not in sys.modules:
        sys.modules["numpy.f2py"] = vars(np)["f2py"] = ModuleType("numpy.f2py", "Left out by o3dleaf.")
