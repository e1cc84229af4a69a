"""Names of version 0.1 do what they did, and say how they are called now."""

import inspect

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from o3dleaf.deprecated import RENAMED, REORDERED


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_is_the_new_one_and_says_so_where_it_is_used(old):
    with pytest.warns(DeprecationWarning, match=f"o3dleaf.{old} is now called {RENAMED[old]};") as caught:
        thing = getattr(o3l, old)
    assert thing is getattr(o3l, RENAMED[old])
    assert caught[0].filename == __file__
    assert old not in dir(o3l)


@pytest.mark.parametrize("old", REORDERED)
def test_an_old_function_takes_the_path_first_and_says_so_where_it_is_used(old):
    with pytest.warns(DeprecationWarning, match=rf"o3dleaf.{old} is now called \w+\(\w+, path\);") as caught:
        function = getattr(o3l, old)
    assert next(iter(inspect.signature(function).parameters)) == "path"
    assert caught[0].filename == __file__


def test_a_mesh_is_written_in_the_old_order_too(tmp_path):
    mesh = np.eye(3), [[0, 1, 2]]
    with pytest.warns(DeprecationWarning, match=r"write_mesh\(mesh, path\)"):
        o3l.write_triangle_mesh(tmp_path / "old.ply", mesh)
    o3l.write_mesh(mesh, tmp_path / "new.ply")
    assert (tmp_path / "old.ply").read_bytes() == (tmp_path / "new.ply").read_bytes()
    assert len(o3d.io.read_triangle_mesh(tmp_path / "old.ply").triangles) == 1
