"""Names of version 0.1 do what they did, and say how they are called now."""

import inspect
from pkgutil import resolve_name

import numpy as np
import pytest

import o3dleaf as o3l
from cloud_shapes import torus
from mesh_fields import CENTRE, sphere
from o3dleaf.deprecated import CHANGED, RENAMED


def old(name):
    """Return an old public name, which must warn where it is used."""
    with pytest.warns(DeprecationWarning, match=f"o3dleaf.{name} is now o3dleaf."):
        return getattr(o3l, name)


@pytest.mark.parametrize("name", [*RENAMED, *CHANGED])
def test_an_old_name_says_what_it_is_now_where_it_is_used(name):
    with pytest.warns(DeprecationWarning, match=f"o3dleaf.{name} is now o3dleaf.") as caught:
        thing = getattr(o3l, name)
    assert caught[0].filename == __file__
    assert name not in dir(o3l)
    assert thing is (CHANGED[name] if name in CHANGED else resolve_name(RENAMED[name]))


@pytest.mark.parametrize("name", CHANGED)
def test_an_old_function_names_what_to_call_in_its_docstring(name):
    new = inspect.getdoc(CHANGED[name]).split("`")[1]
    assert new.split("(")[0].split(".")[0] in o3l.__all__


def test_a_mesh_is_written_in_the_old_order_too(tmp_path):
    mesh = np.eye(3), [[0, 1, 2]]
    old("write_triangle_mesh")(tmp_path / "old.ply", mesh)
    o3l.write_mesh(mesh, tmp_path / "new.ply")
    assert (tmp_path / "old.ply").read_bytes() == (tmp_path / "new.ply").read_bytes()


def test_steps_of_a_cloud_take_points_and_normals_apart():
    points, normals = torus(2000)
    cloud = o3l.OrientedCloud.of(points, normals)
    assert old("cloud_spacing")(points).median == o3l.OrientedCloud.of(points).spacing
    assert np.array_equal(old("merge_points")(points, normals, 0.1).points, o3l.voxel_down_sample(cloud, 0.1).points)
    distance = 0.5 * cloud.spacing
    both = [old("off_surface_constraints")(points, normals, distance), o3l.offset_constraints(cloud, distance, every=1)]
    assert np.array_equal(both[0].values, both[1].values)
    constrained = old("constrain")(points, normals, cloud.spacing)
    assert np.array_equal(constrained.values, o3l.offset_constraints(cloud).values)


def test_stray_points_go_from_a_cloud_without_normals():
    points = np.append(np.random.default_rng(0).uniform(0, 1, (500, 3)) * [1, 1, 0.3], [[9.0, 9, 9], [0, 0, 0]], axis=0)
    assert np.array_equal(
        old("remove_stray_points")(np.append(points, points[:3], axis=0)).points, points[[*range(500), 501]]
    )


def test_steps_of_a_surface_take_points_and_normals_apart():
    ball, points = sphere(), np.random.default_rng(0).normal(size=(2000, 3))
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    points = normals + CENTRE
    mesh = o3l.extract_isosurface(ball, 0.2)
    cloud = o3l.OrientedCloud.of(points, normals)
    assert np.array_equal(old("turned_over")(mesh, points, normals), o3l.find_inverted_regions(mesh, cloud))
    assert np.array_equal(old("support")(mesh, points).distance, o3l.vertex_support(mesh, cloud).distance)
    assert np.array_equal(old("near_data")(points)(points), o3l.distance_mask(cloud)(points))
