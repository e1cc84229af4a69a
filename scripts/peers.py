"""Ways from an oriented cloud to a mesh, ours and its peers, each called in a process of its own.

Every method is a function (points, normals, spacing, is_open) -> (vertices, triangles); its lattice, octree or balls
are as fine as the cloud, `spacing`. What is not said here is the default of its library. `is_open` tells a Poisson
method that the truth has a border: then the vertices of the lowest 1 % of densities go, as in the tutorial of Open3D.
"""

import math
import tempfile
import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import open3d as o3d

import o3dleaf as o3l
from o3dleaf.core.processes.child_process import run_in_subprocess

SCALE = 1.1
"""Side of a Poisson octree over the longest side of the cloud's box."""
MLS_SCALE = 1.2
"""Side of the lattice of MeshLab's moving least squares over the same, as its vertices show."""
TRIMMED = 0.01
WARM_UP = 2000


def rbfpu(points, normals, _spacing, _is_open, *, oriented=True):
    cloud = cloud_of(points, normals) if oriented else o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    mesh, _ = o3l.create_from_point_cloud_rbfpu(cloud)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def open3d_poisson(points, normals, spacing, is_open):
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud_of(points, normals), depth=poisson_depth(points, spacing), scale=SCALE
    )
    return trim(np.asarray(mesh.vertices), np.asarray(mesh.triangles), np.asarray(density), is_open)


def meshlab_poisson(points, normals, spacing, is_open):
    session = meshlab(points, normals)
    depth = poisson_depth(points, spacing)
    session.generate_surface_reconstruction_screened_poisson(depth=depth, scale=SCALE, threads=1)
    mesh = session.current_mesh()
    density = mesh.vertex_scalar_array() if mesh.vertex_number() else np.empty(0)
    return trim(mesh.vertex_matrix(), mesh.face_matrix(), density, is_open)


def apss(points, normals, spacing, _is_open):
    session = meshlab(points, normals)
    session.generate_marching_cubes_apss(resolution=mls_resolution(points, spacing))
    return session.current_mesh().vertex_matrix(), session.current_mesh().face_matrix()


def rimls(points, normals, spacing, _is_open):
    session = meshlab(points, normals)
    session.generate_marching_cubes_rimls(resolution=mls_resolution(points, spacing))
    return session.current_mesh().vertex_matrix(), session.current_mesh().face_matrix()


def ball_pivoting(points, normals, spacing, _is_open):
    radii = o3d.utility.DoubleVector([spacing, 2 * spacing, 4 * spacing])
    mesh = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud_of(points, normals), radii)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def rsr(points, normals, _spacing, _is_open):
    from pygel3d import hmesh  # noqa: PLC0415

    found = hmesh.rsr_recon(points, normals)
    return np.array(found.positions()), np.array([list(found.circulate_face(each)) for each in found.faces()])


def advancing_front(points, _normals, _spacing, _is_open):
    from CGAL import CGAL_Advancing_front_surface_reconstruction as fronts  # noqa: PLC0415
    from CGAL.CGAL_Kernel import Point_3  # noqa: PLC0415
    from CGAL.CGAL_Point_set_3 import Point_set_3  # noqa: PLC0415
    from CGAL.CGAL_Polyhedron_3 import Polyhedron_3  # noqa: PLC0415

    cloud, found = Point_set_3(), Polyhedron_3()
    for point in points.tolist():
        cloud.insert(Point_3(*point))
    fronts.advancing_front_surface_reconstruction(cloud, found)
    return arrays_of_cgal(found)


def alpha_wrap(points, _normals, spacing, _is_open):
    """Shrink a wrap as far as a ball of two spacings' radius goes, off by that over 30 as CGAL advises."""
    from CGAL import CGAL_Alpha_wrap_3 as wraps  # noqa: PLC0415
    from CGAL.CGAL_Kernel import Point_3  # noqa: PLC0415
    from CGAL.CGAL_Polyhedron_3 import Polyhedron_3  # noqa: PLC0415

    cloud, found = wraps.Point_3_Vector(), Polyhedron_3()
    for point in points.tolist():
        cloud.append(Point_3(*point))
    wraps.alpha_wrap_3(cloud, 2 * spacing, spacing / 15, found)
    return arrays_of_cgal(found)


def arrays_of_cgal(mesh):
    """Return vertices and triangles of CGAL's polyhedron, by way of a file: six digits."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.off"
        mesh.write_to_file(str(path))
        numbers = path.read_text().split()[1:]
    count, faces = int(numbers[0]), int(numbers[1])
    vertices = np.array(numbers[3 : 3 + 3 * count], dtype=np.float64).reshape(-1, 3)
    return vertices, np.array(numbers[3 + 3 * count :][: 4 * faces], dtype=np.int64).reshape(-1, 4)[:, 1:]


METHODS = {
    each.__name__: each
    for each in (
        rbfpu,
        open3d_poisson,
        meshlab_poisson,
        apss,
        rimls,
        ball_pivoting,
        rsr,
        advancing_front,
        alpha_wrap,
    )
}
EXTRAS = {"rsr": "pygel3d", "advancing_front": "CGAL", "alpha_wrap": "CGAL"}
"""The packages, of the extra `bench`, that methods need."""


def is_there(method):
    """Say whether this version of o3dleaf has the method, or its package is installed."""
    if method in EXTRAS:
        return find_spec(EXTRAS[method]) is not None
    return method != "rbfpu" or hasattr(o3l, "create_from_point_cloud_rbfpu")


def poisson_depth(points, spacing):
    """Return the least depth whose finest cells, SCALE L / 2**depth, are no longer than the spacing."""
    return max(1, math.ceil(math.log2(SCALE * np.ptp(points, axis=0).max() / spacing)))


def mls_resolution(points, spacing):
    """Return the least number of cells, MLS_SCALE L / resolution long, that are no longer than the spacing."""
    return max(1, math.ceil(MLS_SCALE * np.ptp(points, axis=0).max() / spacing))


def trim(vertices, triangles, density, is_open):
    """Return the mesh without the vertices of the lowest densities, if it has a border."""
    if not is_open or not len(triangles):
        return vertices, triangles
    kept = density >= np.quantile(density, TRIMMED)
    return vertices, triangles[kept[triangles].all(axis=1)]


def cloud_of(points, normals):
    """Return an Open3D cloud."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    return cloud


def meshlab(points, normals):
    """Return a MeshLab session that holds a cloud."""
    import pymeshlab  # noqa: PLC0415  seconds that the other methods need not wait

    session = pymeshlab.MeshSet(verbose=False)
    session.add_mesh(pymeshlab.Mesh(points, v_normals_matrix=normals))
    return session


def reconstruct(points, normals, method, spacing, is_open, seconds, *, oriented=True):
    """Return (vertices, triangles, seconds, processor seconds, peak MB) of a method, run in a fresh process.

    Raises O3DLeafError if it crashes, fails, or does not end within `seconds`, the start of the process included.
    """
    options = {"method": method, "spacing": spacing, "is_open": is_open, "oriented": oriented}
    outcome = run_in_subprocess(
        serve,
        (points, normals),
        options,
        name=method,
        cure="it is reported as failed",
        seconds=seconds,
    )
    vertices, triangles, used = outcome.arrays
    return vertices, triangles, *used.tolist()


def serve(points, normals, method, spacing, is_open, oriented):
    """Call a method, in the child: warmed up on balls and a block, so that neither imports nor compilation are counted.

    A cloud that is not oriented has normals for the peers; ours is not given them.
    """
    call, rng = METHODS[method], np.random.default_rng(0)
    if not oriented and call is rbfpu:
        call = partial(rbfpu, oriented=False)
    ball = rng.normal(size=(WARM_UP, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, np.newaxis]
    for noise in (0.0, 0.02):  # what is done for a noisy cloud is more
        call(ball + rng.normal(scale=noise, size=ball.shape), ball, math.sqrt(4 * math.pi / WARM_UP), False)
    block = o3l.samples.Block()
    call(*block.sample(WARM_UP), math.sqrt(block.area / WARM_UP), False)  # and for one with creases
    before = forget_peak()
    start, processor = time.perf_counter(), time.process_time()
    vertices, triangles = call(points, normals, spacing, is_open)
    used = [time.perf_counter() - start, time.process_time() - processor, memory("VmHWM") - before]
    return np.array(vertices, dtype=np.float64), np.array(triangles, dtype=np.int64), np.array(used)


def forget_peak():
    """Set the peak of the resident memory back to what is resident now, and return that; NaN where one cannot."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return math.nan
    return memory("VmRSS")


def memory(name):
    """Return a figure of this process's memory in MB; NaN where the system does not say."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return math.nan
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(name))
