"""A process that starts without Dash and f2py has all of Open3D and SciPy that we call; one with them keeps them."""

import subprocess
import sys

import pytest

LEFT_OUT = """
import sys
from o3dleaf.core.processes.light_imports import import_lightly
import_lightly()
import open3d as o3d
assert "dash.dash" not in sys.modules
assert o3d.visualization.draw_plotly and o3d.visualization.draw_geometries
import scipy.linalg, scipy.optimize, scipy.spatial, numba
assert "numpy.f2py.f2py2e" not in sys.modules
assert scipy.linalg.solve([[2.0]], [4.0]) == 2.0
import o3dleaf.leaf.pipeline
assert "pymeshlab" not in sys.modules
"""
KEPT = """
import dash
from numpy import f2py
from o3dleaf.core.processes.light_imports import import_lightly
import_lightly()
import sys
assert sys.modules["dash"] is dash and dash.Dash is not None
import numpy.f2py
assert numpy.f2py is f2py and f2py.run_main
"""


@pytest.mark.parametrize("program", [LEFT_OUT, KEPT], ids=["left out", "kept"])
def test_what_nobody_calls_is_left_out_where_nobody_has_it(program):
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
