"""What a step or an edge would make is counted before the work, and refused where it does not fit: see o3l.errors."""

import time

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf.core.errors import MemoryBudgetError, O3DLeafError
from tolerances import REFUSAL_SECONDS


@pytest.fixture(scope="module")
def mesh():
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 10)


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.04 - z**2))[0]


WORK = {
    "fill_particles": lambda mesh, leaf, step, path: o3l.fill_particles(mesh, step),
    "sample_particles": lambda mesh, leaf, step, path: o3l.sample_particles(mesh, step),
    "remesh": lambda mesh, leaf, step, path: o3l.remesh(mesh, step),
    "export_distance": lambda mesh, leaf, step, path: o3l.export_distance(mesh, path / "d.vti", step),
    "extract_isosurface": lambda mesh, leaf, step, path: o3l.extract_isosurface(o3l.samples.Torus(), step),
    "reconstruct": lambda mesh, leaf, step, path: o3l.create_from_point_cloud_rbfpu(np.asarray(mesh.vertices), step),
    "plan_mesh": lambda mesh, leaf, step, path: leaf.plan_mesh(step),
    "plan_mesh of a region": lambda mesh, leaf, step, path: leaf.plan_mesh(step, [[1, -1], [1.1, -0.9]]),
    "extract_levels": lambda mesh, leaf, step, path: leaf.extract_levels(step, []),
    "write_mesh": lambda mesh, leaf, step, path: leaf.write_mesh(path / "m.ply", step),
    "extract_tile": lambda mesh, leaf, step, path: leaf.extract_tile(step),
    "write_grid": lambda mesh, leaf, step, path: leaf.write_grid(path / "g.vti", step),
    "blade": lambda mesh, leaf, step, path: leaf.blade.extract_mesh(step),
}


@pytest.mark.parametrize("step", [1e-7, 1e-12, 1e-29])
@pytest.mark.parametrize("name", WORK)
def test_a_step_of_nothing_is_refused_in_a_moment_with_the_number(name, step, mesh, leaf, tmp_path):
    for _ in range(2):  # the first time compiles what no code came for
        start = time.process_time()
        with pytest.raises(O3DLeafError, match=r"needs? .*[TG]B|too many") as refused:
            WORK[name](mesh, leaf, step, tmp_path)
    assert time.process_time() - start < REFUSAL_SECONDS
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["fill_particles", "sample_particles", "remesh", "plan_mesh", "blade"])
def test_what_is_stated_is_held_to(name, mesh, leaf, tmp_path):
    """Below it, the step that the line names is allowed: it is counted, and then the work is done."""
    with o3l.memory_limit("1MB"), pytest.raises(MemoryBudgetError, match="state more"):
        WORK[name](mesh, leaf, 0.002, tmp_path)
