"""What a process of ours does without: modules that a library imports for functions which we never call."""

import sys
from types import ModuleType


def import_without_dash() -> None:
    """Let Open3D import an empty Dash, the web server of `draw_plotly_server`: a third of a second less to start.

    For processes that are ours from the start, the command line and its children. Where Dash is loaded it stays.
    """
    if "dash" not in sys.modules:
        empty = ModuleType("dash", "Left out by o3dleaf.")
        vars(empty).update(html=None, dcc=None, Dash=None)
        sys.modules["dash"] = empty
