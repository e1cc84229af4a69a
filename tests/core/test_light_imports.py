"""A process that starts without Dash has all of Open3D but the server of `draw_plotly_server`; one with it keeps it."""

import subprocess
import sys

import pytest

LEFT_OUT = """
import sys
from o3dleaf.core.processes.light_imports import import_without_dash
import_without_dash()
import open3d as o3d
assert "dash.dash" not in sys.modules
assert o3d.visualization.draw_plotly and o3d.visualization.draw_geometries
"""
KEPT = """
import dash
from o3dleaf.core.processes.light_imports import import_without_dash
import_without_dash()
import sys
assert sys.modules["dash"] is dash and dash.Dash is not None
"""


@pytest.mark.parametrize("program", [LEFT_OUT, KEPT], ids=["left out", "kept"])
def test_dash_is_left_out_where_nobody_has_it(program):
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
