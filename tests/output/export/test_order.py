"""The object first, the path second: the other order, of version 0.1 and of Open3D, is refused in one line."""

import numpy as np
import pytest

import o3dleaf as o3l


@pytest.mark.parametrize(
    ("write", "thing"),
    [
        (o3l.write_mesh, "mesh"),
        (o3l.export_mesh, "mesh"),
        (o3l.export_particles, "particles"),
        (lambda path, mesh: o3l.export_distance(path, mesh, 0.1), "mesh"),
    ],
    ids=["write_mesh", "export_mesh", "export_particles", "export_distance"],
)
@pytest.mark.parametrize("kind", [str, lambda path: path])
def test_a_path_in_the_place_of_the_object_is_refused(tmp_path, write, thing, kind):
    mesh = np.eye(3), [[0, 1, 2]]
    with pytest.raises(o3l.errors.InputError, match=f"takes the {thing} first, then the path"):
        write(kind(tmp_path / "a.ply"), mesh)
    assert list(tmp_path.iterdir()) == []
