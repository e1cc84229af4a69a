"""A surface covered and a solid filled with particles, for SPH and other codes without a mesh."""

from dataclasses import dataclass
from os import PathLike

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Unit, Whole
from o3dleaf.core.atomic_files import claim, require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.io.clouds.bgeo import write_bgeo_points
from o3dleaf.io.labelled_mesh import AnyMesh, LabelArray
from o3dleaf.io.mesh_data import MeshData, face_vectors, unit_comment, unit_rows
from o3dleaf.io.ply import write_ply_points
from o3dleaf.io.vtk import Table, write_vtp_points
from o3dleaf.output.export.particle_loops import assign_samples, crossings, thin_samples
from o3dleaf.output.export.thinning import sort_into_cubes, surface_samples
from o3dleaf.surface.mesh.topology import EdgeTable

FINER = 2
"""Parts that triangles are sampled by are at most 1/FINER of the spacing long: particles are chosen among them."""
BLOCK = 1 << 14
SUFFIXES = (".ply", ".csv", ".vtp", ".bgeo")
"""Formats of particles."""


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Particles:
    """Points with what each of them stands for.

    Attributes
    ----------
    points : (n, 3) ndarray
        In `unit`.
    normals : (n, 3) ndarray, or None
        Outward unit normals, of particles on a surface.
    sizes : (n,) ndarray
        The area that a particle on a surface stands for, or the volume of one inside.
    labels : (n,) ndarray of uint8, or None
        Of particles on a surface: the label of the triangle.
    unit : str, optional
    layers : (n,) ndarray of int64, or None
        Of a boundary in layers: 0 on the surface, 1 one spacing below it, and so on; see `sample_boundary`.
    """

    points: FloatArray
    normals: FloatArray | None
    sizes: FloatArray
    labels: LabelArray | None = None
    unit: Unit | None = None
    layers: IntArray | None = None

    def __repr__(self) -> str:
        where = "inside" if self.normals is None else "on a surface" if self.layers is None else "in layers"
        unit = "" if self.unit is None else f", unit {self.unit}"
        return f"Particles({len(self.points):,} {where}{unit})"


@checked
def sample_particles(
    mesh: AnyMesh,
    spacing: Positive,
    *,
    labels: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    seed: Whole = 0,
) -> Particles:
    """Return particles on a surface, no two of one face nearer than `spacing`, none missing where one has room.

    Poisson-disc sampling: the triangles are sampled by parts no longer than half the spacing, and of the samples,
    taken in a random order, each is kept unless one was kept nearer than the spacing on the same face (normals less
    than a right angle apart). A particle's area is that of the samples to which it is the nearest of their face, so
    that all areas add up to the surface's. On a plane a particle stands for about 1.4 · spacing².

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
    spacing : float
        Least distance of two particles, in the mesh's unit.
    labels : (m,) array_like of int, optional
        Of the triangles; by default those that the mesh brings.
    unit : str, optional
        Unit of the mesh.
    seed : int
        Of the order.

    Raises
    ------
    InputError
        If the mesh is empty or without area.
    MemoryBudgetError
        If the spacing is so small that the samples, among which particles are chosen, do not fit into memory.
    """
    step = require_positive(spacing, "spacing")
    surface = MeshData.of(mesh, labels, unit)
    points, triangle, sizes = cover_surface(surface, step, step, seed)
    normals = unit_rows(face_vectors(surface.vertices[surface.triangles[triangle]]))
    own = None if surface.labels is None else surface.labels[triangle]
    return Particles(points, normals, sizes, own, surface.unit)


def cover_surface(
    surface: MeshData, spacing: float, step: float, seed: int, copies: int = 1
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return points, triangles and areas of samples, no two of one face nearer than `spacing`; see `sample_particles`.

    They are chosen among the middles of parts of the triangles, at most `step` / FINER long. `copies` is how often the
    caller will hold as many.
    """
    corners = surface.vertices[surface.triangles]
    vectors = face_vectors(corners)
    normals, areas = unit_rows(vectors), np.linalg.norm(vectors, axis=1) / 2
    points, triangle, shares = surface_samples(corners, areas, step / FINER, step, copies)
    by_cube, cube, starts, neighbors = sort_into_cubes(points, spacing)
    points, triangle, shares = points[by_cube], triangle[by_cube], shares[by_cube]
    order = np.random.default_rng(seed).permutation(len(points))
    members, nearest = np.empty((2, len(points)), dtype=np.int64)
    counts = np.zeros(len(starts), dtype=np.int64)
    samples = points, normals, triangle, cube, starts, neighbors

    def task(start: int, stop: int) -> None:
        assign_samples(*samples, members, counts, spacing, start, stop, nearest)

    thinning, assigning = progress.split(1, 1)
    with thinning:
        for start, stop in blocks(len(points), BLOCK):
            thin_samples(*samples, order[start:stop], spacing, members, counts)
            progress.report(stop, len(points))
    with assigning:
        run_blocks(task, len(points), BLOCK, reports=True)
    kept, place = np.unique(nearest, return_inverse=True)
    sizes: FloatArray = np.bincount(place, weights=shares).astype(np.float64)
    return points[kept], triangle[kept], sizes


@checked
def fill_particles(mesh: AnyMesh, step: Positive, *, unit: Unit | None = None) -> Particles:
    """Return particles inside a closed mesh, at the middles of the cubes of edge `step` of one lattice of the world.

    Inside is decided exactly in the plane: a column of the lattice passes the mesh an odd number of times below a point
    inside, and where it meets an edge, one of its triangles is passed.

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Closed: every edge has two triangles.
    step : float
        Distance of neighbors, in the mesh's unit; each particle's volume is step³.
    unit : str, optional
        Unit of the mesh.

    Raises
    ------
    InputError
        If the mesh is open, or too thin for a particle at this step.
    MemoryBudgetError
        If the step is so small that the particles do not fit into memory.
    """
    dp = require_positive(step, "step")
    surface = MeshData.of(mesh, None, unit)
    _require_room(surface, dp)
    first, shape = _lattice(surface.vertices, dp)
    origin = (first + 0.5) * dp
    column, height = columns_through(surface, origin, dp, shape)
    # Between the crossing 2k and 2k + 1 of a column is inside.
    low = np.ceil((height[0::2] - origin[2]) / dp).astype(np.int64)
    high = np.ceil((height[1::2] - origin[2]) / dp).astype(np.int64)
    count = np.maximum(high - low, 0)
    if not count.sum():
        raise InputError(f"step: at {dp:g} no particle lies inside; give a smaller one")
    ends = np.cumsum(count)
    k = np.arange(ends[-1]) - np.repeat(ends - count, count) + np.repeat(low, count)
    plane = np.repeat(column[0::2], count)
    points = origin + np.stack([plane // shape[1], plane % shape[1], k], axis=1) * dp
    return Particles(points, None, np.full(len(points), dp**3), None, surface.unit)


def _require_room(mesh: MeshData, step: float) -> None:
    """Raise `MemoryBudgetError` if the particles in a mesh, by its volume, do not fit into memory."""
    corners = (mesh.vertices - mesh.vertices.mean(axis=0))[mesh.triangles]
    volume = abs(float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))) / 6
    with np.errstate(over="ignore", divide="ignore"):
        count = float(np.float64(volume) / step / step / step)
    held = measured.PARTICLE * count
    require_resources(held, f"step: about {in_words(count)} particles", "give a larger one", step=step, power=3)


def _lattice(vertices: FloatArray, step: float) -> tuple[FloatArray, tuple[int, int, int]]:
    """Return the number of the first cube along each axis, and how many there are."""
    first = np.floor(vertices.min(axis=0) / step)
    count = (np.floor(vertices.max(axis=0) / step) - first + 1).astype(int)
    return first, (int(count[0]), int(count[1]), int(count[2]))


def require_closed(mesh: MeshData) -> None:
    """Raise `InputError` unless every edge has two triangles."""
    if (EdgeTable.of(mesh.triangles).count != 2).any():
        raise InputError("mesh: is open, or edges branch; mesh the leaf with closed=True, or close its holes")


def columns_through(
    mesh: MeshData, origin: FloatArray, step: float, shape: tuple[int, int, int]
) -> tuple[IntArray, FloatArray]:
    """Return columns (i · ny + j) and heights of their crossings with a closed mesh, column by column, upwards.

    Raises
    ------
    InputError
        If the mesh is open.
    """
    require_closed(mesh)
    vertices, triangles = mesh.vertices, mesh.triangles
    with np.errstate(over="ignore", divide="ignore"):
        count = float(np.abs(face_vectors(vertices[triangles])[:, 2]).sum() / 2 / step / step)
    what = f"step: about {in_words(count)} columns of the grid through the mesh"
    require_resources(measured.CROSSING * count, what, "give a larger one", step=step)
    crossed: dict[int, tuple[IntArray, FloatArray]] = {}

    def task(start: int, stop: int) -> None:
        none = np.empty(0, dtype=np.int64), np.empty(0)
        count = crossings(vertices, triangles, origin, step, shape, start, stop, *none)
        kept = np.empty(count, dtype=np.int64), np.empty(count)
        crossings(vertices, triangles, origin, step, shape, start, stop, *kept)
        crossed[start] = kept

    run_blocks(task, len(triangles), BLOCK, reports=True)
    column = np.concatenate([crossed[start][0] for start in sorted(crossed)])
    height = np.concatenate([crossed[start][1] for start in sorted(crossed)])
    order = np.lexsort((height, column))
    return column[order], height[order]


@checked
def export_particles(particles: Particles, path: str | PathLike[str], *, to_unit: Unit | None = None) -> None:
    """Write particles: PLY, VTP or CSV with every digit, or BGEO; the file appears whole or not at all.

    Columns: x, y, z; nx, ny, nz, where there are normals; area or volume; label and layer, where there are. Lengths,
    areas and volumes are in the file's unit, which PLY and VTP state in a comment and CSV in its first line. BGEO is
    single precision and states no unit: move the origin to where the particles are.

    Parameters
    ----------
    particles : Particles
    path : path-like
    to_unit : str, optional
        Unit of the file; that of the particles by default.

    Raises
    ------
    InputError
        If the suffix is unknown or the folder cannot be written to.
    UnitError
        If lengths must be converted and the particles' unit is not known.
    """
    target = require_writable(path, SUFFIXES)
    unit = particles.unit if to_unit is None else check_unit(to_unit)
    scale = unit_scale(particles.unit, unit)
    on_surface = particles.normals is not None
    size, power = ("area", 2) if on_surface else ("volume", 3)
    numbers = {"label": particles.labels, "layer": particles.layers}
    table = {size: particles.sizes * scale**power} | {name: each for name, each in numbers.items() if each is not None}
    note = f"o3dleaf particles, unit {unit or 'not stated'}"
    with whole_file(target) as temporary, temporary.open("r+b") as out:
        if target.suffix.lower() == ".bgeo":
            turned: Table = {} if particles.normals is None else {"N": particles.normals}
            write_bgeo_points(out, particles.points * scale, {**turned, **table})
            return
        if target.suffix.lower() == ".vtp":
            extra: Table = {} if particles.normals is None else {"Normals": particles.normals}
            write_vtp_points(out, particles.points * scale, {**extra, **table}, note)
            return
        columns = dict(zip("xyz", particles.points.T * scale, strict=True))
        if particles.normals is not None:
            columns |= dict(zip(("nx", "ny", "nz"), particles.normals.T, strict=True))
        columns |= table
        if target.suffix.lower() == ".csv":
            content = _csv(columns, note)
            claim(out, len(content))
            out.write(content)
        else:
            write_ply_points(out, columns, unit_comment(unit))


def _csv(columns: dict[str, npt.NDArray[np.generic]], note: str) -> bytes:
    """Return a table with commas, every digit of every number."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    return f"# {note}\n{','.join(columns)}\n{text}".encode()
