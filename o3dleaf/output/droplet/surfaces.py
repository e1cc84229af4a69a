"""The surfaces that a droplet meets: the leaf's, the same without hairs, and its smooth twin."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter, grey_opening

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.units import unit_scale
from o3dleaf.io.labelled_mesh import ABAXIAL, ADAXIAL, RIM, LabelArray, LabelledMesh
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.droplet.frame import ImpactFrame, mean_height

HAIR = 0.25
"""Millimeters: what is shorter than this along the leaf and stands out of the blade is a hair; wheat's reach 0.2 along
it, and its ridges run on."""
LAYERS = 8
"""Heights are looked for in steps of the window's step over this, then between two."""
ROUNDS = 3
"""Corrections of the twin's height: on a blade that bends little the second is right, up to rounding."""
VARIANTS = ("leaf", "twin", "bare")
"""The leaf, its smooth twin, and the leaf without hairs."""


@dataclass(frozen=True, eq=False)
class LandingWindow:
    """The part of a leaf around a landing place.

    Attributes
    ----------
    leaf : MultiscaleLeaf
    place : (float, float)
        Along and across.
    size : float
        Its width in the world, in the leaf's unit.
    step : float
        Edge length of its triangles, in the leaf's unit.
    """

    leaf: MultiscaleLeaf
    place: tuple[float, float]
    size: float
    step: float

    @cached_property
    def region(self) -> FloatArray:
        """(2, 2) lower and upper (along, across), as much of the plane as is `size` wide in the world.

        Raises
        ------
        InputError
            If it leaves the blade.
        """
        lifted = self.leaf.blade.lift_with_jacobian(np.array([[*self.place, 0.0]]))
        half = self.size / 2 / np.linalg.norm(lifted.columns[0, :2], axis=1)
        region = np.array([self.place - half, self.place + half])
        if not shapely.box(*region.ravel()).within(self.leaf.edge_curve(closed=True)):
            raise InputError(
                f"at: around along {self.place[0]:g}, across {self.place[1]:g} a window of {self.size:g} "
                f"{self.leaf.unit or ''} leaves the blade; choose a place further inside, or a smaller size"
            )
        return region

    @cached_property
    def frame(self) -> ImpactFrame:
        """The frame whose z is 0 at the mean height of the leaf's adaxial face."""
        rough = ImpactFrame.at(self.leaf.blade, self.place)
        return rough.raised(adaxial_height(self.solid, rough))

    @cached_property
    def solid(self) -> LabelledMesh:
        """The window of the leaf as a closed solid, remeshed, in the world."""
        return self.leaf.plan_mesh(self.step, self.region, closed=True).extract(remesh=self.step)

    @cached_property
    def grid(self) -> tuple[FloatArray, FloatArray]:
        """Ticks along and across, about a step apart, from side to side."""
        count = np.maximum(np.round(np.ptp(self.region, axis=0) / self.step).astype(int), 2) + 1
        low, high = self.region.tolist()
        along, across = (np.linspace(low[axis], high[axis], int(count[axis])) for axis in range(2))
        return along, across

    def surface(self, variant: str) -> LabelledMesh:
        """Return a closed solid with labels in the frame, in the leaf's unit."""
        made = {"leaf": lambda: self.solid, "twin": lambda: self.twin, "bare": lambda: self.bare}[variant]()
        vertices, triangles = mesh_arrays(made.mesh)
        return replace(made, mesh=build_mesh(self.frame.to_local(vertices), triangles))

    @cached_property
    def twin(self) -> LabelledMesh:
        """The blade alone, bent as it is, its upper face at the same mean height as the leaf's."""
        shape = tuple(map(len, self.grid))
        height, below = 0.0, float(self.leaf.heights[0])
        for _ in range(ROUNDS):
            top = np.full(shape, height)
            made = self.sheet(top, np.full(shape, min(below, height - self.step)))
            height -= adaxial_height(made, self.frame)
        return made

    @cached_property
    def bare(self) -> LabelledMesh:
        """The leaf without hairs, which stays where it is."""
        top = self.bare_heights
        return self.sheet(top, np.full(top.shape, min(float(self.leaf.heights[0]), float(top.min()) - self.step)))

    @cached_property
    def bare_heights(self) -> FloatArray:
        """Heights of the adaxial face over the grid, hairs taken off.

        `top_heights`, opened along the leaf (a maximum of minima over `HAIR`): what stands out of the blade and is
        shorter goes; ridges, which run along it, stay, as do pits. What was taken off is smoothed over a step.
        """
        heights, extra = self._long_heights
        length = 2 * round(extra / 2) + 1
        opened = grey_opening(heights, size=(length, 1), mode="nearest")
        smooth = gaussian_filter(opened, 1.0, mode="nearest")
        # Only where hairs were, and beside; elsewhere the face is as it was.
        near = gaussian_filter((heights - opened > self.step / 2).astype(float), 2.0, mode="nearest")
        weight = np.clip(4 * near, 0, 1)
        return np.asarray((weight * smooth + (1 - weight) * opened)[extra:-extra])

    @cached_property
    def top_heights(self) -> FloatArray:
        """Heights of the highest points of the leaf over the grid, hairs too."""
        heights, extra = self._long_heights
        return heights[extra:-extra]

    @cached_property
    def _long_heights(self) -> tuple[FloatArray, int]:
        """Heights over a grid that is longer along by some rows at each end, and how many."""
        reach = HAIR * unit_scale("mm", self.leaf.unit)
        along, across = self.grid
        step = float(along[1] - along[0])
        extra = int(np.ceil(reach / step))
        longer = along[0] + step * np.arange(-extra, len(along) + extra)
        return highest_points(self.leaf, longer, across, self.step / LAYERS), extra

    def sheet(self, top: FloatArray, bottom: FloatArray) -> LabelledMesh:
        """Return the solid between two heights over the grid, lifted to the world."""
        plane = np.stack(np.meshgrid(*self.grid, indexing="ij"), axis=-1).reshape(-1, 2)
        flat = np.concatenate([np.column_stack([plane, each.ravel()]) for each in (top, bottom)])
        triangles, labels = grid_solid(*top.shape)
        return LabelledMesh(build_mesh(self.leaf.blade.lift(flat), triangles), labels, unit=self.leaf.unit)


def adaxial_height(mesh: LabelledMesh, frame: ImpactFrame) -> float:
    """Return the mean height of the adaxial face of a mesh of the world in a frame."""
    vertices, triangles = mesh_arrays(mesh.mesh)
    return mean_height(frame.to_local(vertices), triangles[mesh.labels == ADAXIAL])


def highest_points(leaf: MultiscaleLeaf, along: FloatArray, across: FloatArray, step: float) -> FloatArray:
    """Return the height of the highest point of the leaf over each place of a grid, to a fraction of the step."""
    low, high = leaf.heights
    levels = np.linspace(high, low, int(np.ceil((high - low) / step)) + 1)
    points = np.stack(np.meshgrid(along, across, levels, indexing="ij"), axis=-1)
    values = leaf.values(points.reshape(-1, 3)).reshape(points.shape[:3])
    inside = values > 0
    if not inside.any(axis=2).all():
        raise InputError("at: the blade has a hole there; choose another place")
    first = np.maximum(inside.argmax(axis=2), 1)
    rows = np.ogrid[: len(along), : len(across)]
    above, below = values[(*rows, first - 1)], values[(*rows, first)]
    share = np.where(below > above, -above / np.where(below > above, below - above, 1.0), 0.0)
    return np.asarray(levels[first - 1] - np.clip(share, 0, 1) * (levels[0] - levels[1]))


def grid_solid(rows: int, columns: int) -> tuple[IntArray, LabelArray]:
    """Return triangles and labels of the solid between two grids of vertices, the upper one first."""
    count = rows * columns
    number = np.arange(count).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    top = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    # Around the grid, counter-clockwise seen from above.
    ring = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    ahead = np.roll(ring, -1)
    walls = np.concatenate(
        [np.column_stack([ring + count, ahead + count, ahead]), np.column_stack([ring + count, ahead, ring])]
    )
    triangles = np.concatenate([top, top[:, ::-1] + count, walls])
    labels = np.repeat([ADAXIAL, ABAXIAL, RIM], [len(top), len(top), len(walls)]).astype(np.uint8)
    return triangles, labels
