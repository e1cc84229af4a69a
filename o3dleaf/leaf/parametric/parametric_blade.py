"""The blade as a parametrised surface: x = S(u, v) + w τ n over a chart, inside its margin."""

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import open3d as o3d
import shapely

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points, require_near
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.blade.blade import Blade, OpenEdges
from o3dleaf.leaf.blade.distortion import radii_of
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.blade.outline_area import Outline, distances_beyond, in_polygon
from o3dleaf.leaf.chart.petiole import Petiole
from o3dleaf.leaf.instancing.footprint import EdgeThickness
from o3dleaf.leaf.margin.sheet_mesh import triangulate
from o3dleaf.leaf.margin.taper import Taper
from o3dleaf.leaf.parametric import lift_loops
from o3dleaf.leaf.parametric.feet import SAMPLE_COUNT, sample_surface
from o3dleaf.leaf.parametric.feet_loops import Samples
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.parametric.thickness import Thickness, ThicknessMap, ThicknessProduct

COLLAR = 1.0
"""Width of the strip around the outline with samples of its own, in their steps: tips may be narrower than a step."""
BLOCK = 1 << 12
NO_TAPER = np.empty((0, 3))


@checked
@dataclass(frozen=True, eq=False)
class ParametricBlade(Blade):
    r"""A surface over its chart, lengths on it those of the chart as nearly as can be, and heights along its normal.

    .. math:: x = S(u, v) + w\, τ(u, v)\, n(u, v)

    u runs along the midrib and v across it; n is the unit normal S_u × S_v / |S_u × S_v|, to the adaxial side. τ
    falls from 1 towards the margin within `rim_radius`, times the map `thickness`; without either it is 1. Flat
    coordinates of a point are those of its foot on the surface, the closest one, and its height there over τ.

    Attributes
    ----------
    surface : ChartSurface
    outline : Outline
        The margin, in the chart.
    rim_radius : float or None
        In `unit`.
    notes : tuple of str
        What was found while it was built, and what does not hold, a line each.
    thickness : ThicknessMap or None
    petiole : Petiole or None
        What was cut off of the scan.
    other_pieces : (k, 3) ndarray or None
        Points of the scan that belong to other pieces than the one that was asked for, in `unit`.
    several_pieces : bool
        Whether the scan has other pieces that could be asked for; not kept in a file.
    """

    surface: ChartSurface
    outline: Outline
    rim_radius: Positive | None = None
    notes: tuple[str, ...] = ()
    thickness: ThicknessMap | None = None
    petiole: Petiole | None = None
    other_pieces: FloatArray | None = None
    several_pieces: bool = False

    open_edges: ClassVar[OpenEdges] = "cut"

    def __post_init__(self) -> None:
        """Refuse a rim without a radius, and other pieces that are no points."""
        if self.rim_radius is not None:
            require_positive(self.rim_radius, "rim_radius")
        if self.other_pieces is not None:
            as_points(self.other_pieces, "other_pieces", dim=3)

    def __repr__(self) -> str:
        along, across = np.ptp(self.outline.bounds, axis=0)
        return f"ParametricBlade({along:.4g} × {across:.4g}{f' {self.unit}' if self.unit else ''})"

    @property
    def unit(self) -> str | None:
        """Unit of length of the world and of flat coordinates."""
        return self.surface.unit

    def state(self) -> dict[str, Any]:
        """Return what the blade is made of, for `o3dleaf.io.models.model_file`; what it may lack only where it is."""
        state = {name: getattr(self, name) for name in ("surface", "outline", "rim_radius", "notes")}
        extras = {name: getattr(self, name) for name in ("thickness", "petiole", "other_pieces")}
        return state | {name: extra for name, extra in extras.items() if extra is not None}

    @cached_property
    def taper(self) -> Thickness | None:
        """The factor of heights, where it is not 1."""
        if self.thickness is None or self.rim is None:
            return self.rim or self.thickness
        return ThicknessProduct(self.rim, self.thickness)

    @cached_property
    def rim(self) -> Taper | None:
        """The factor that falls towards the margin, where there is one."""
        return None if self.rim_radius is None else Taper(self.outline.polygon, self.rim_radius)

    def edge_thickness(self, reach: float) -> EdgeThickness | None:
        """Return the thickness at a mesh's edge, which lies within `reach` of the outline; None where it is 1.

        τ rises so steeply there that the chords of a mesh, which lie inside the margin by a hundredth of their length,
        would have twice the thickness between their ends.
        """
        taper, rim = self.taper, self.rim
        if taper is None or rim is None:
            return None

        def thickness(plane: FloatArray) -> tuple[FloatArray, FloatArray]:
            return taper.values(plane), rim.values(plane, reach) / rim.values(plane)

        return thickness

    @property
    def most_thickness(self) -> float:
        """The largest factor of heights."""
        return 1.0 if self.thickness is None else self.thickness.most

    @cached_property
    def samples(self) -> Samples:
        """Samples of the surface, inside the outline and a little around it, from which feet are found."""
        step = float(np.sqrt(self.outline.area / SAMPLE_COUNT))
        area = self.outline.polygon.buffer(COLLAR * step)
        shapely.prepare(area)
        bounds = np.array(area.bounds).reshape(2, 2)
        beyond = partial(distances_beyond, self.outline.polygon)
        return sample_surface(self.surface.balls, bounds, step, lambda places: in_polygon(area, places), beyond)

    def flatten(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) flat coordinates of world points (n, 3): their feet (u, v), and heights over τ."""
        plane, heights, _ = self.surface.feet(x, samples=self.samples)
        flat = np.column_stack([plane, heights])
        if self.taper is not None:
            flat[:, 2] /= self.taper.values(plane)
        return flat

    def lift(self, flat: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points S + w τ n of (n, 3) flat coordinates: the inverse of `flatten`."""
        places = as_points(flat, "flat", dim=3)
        require_near(places[:, :2], self.surface.bounds, "flat")
        points, tapers, balls = np.empty_like(places), self._tapers(places), self.surface.balls

        def task(start: int, stop: int) -> None:
            rows = slice(start, stop)
            lift_loops.lift(places[rows], tapers[rows], balls, points[rows])

        run_blocks(task, len(places), BLOCK)
        return points

    def lift_with_jacobian(self, flat: FloatArray) -> Lifted:
        """Return the world points of (n, 3) flat coordinates, and the lift's Jacobian there."""
        lifted = Lifted(np.empty_like(flat), np.empty((len(flat), 3, 3)))
        tapers, balls = self._tapers(flat), self.surface.balls

        def task(start: int, stop: int) -> None:
            rows = slice(start, stop)
            into = lifted.world[rows], lifted.columns[rows]
            lift_loops.lift_with_jacobian(flat[rows], tapers[rows], balls, *into)

        run_blocks(task, len(flat), BLOCK)
        return lifted

    def _tapers(self, flat: FloatArray) -> FloatArray:
        """Return τ, τ_u, τ_v (n, 3), or no rows where τ is 1 everywhere."""
        return NO_TAPER if self.taper is None else self.taper.jet(flat[:, :2])

    def focal_heights(self, plane: FloatArray) -> FloatArray:
        """Return the heights (n,) above or below the (n, 2) places at which the lift folds; ∞ where it never does."""
        curvature = np.abs(self.surface.curvatures(plane)).max(axis=1, initial=0.0)
        if self.taper is not None:
            curvature *= self.taper.values(plane)
        return radii_of(curvature, self.surface.length)

    @checked
    def extract_mesh(self, spacing: Positive, region: npt.ArrayLike | None = None) -> o3d.geometry.TriangleMesh:
        """Return the blade as one open sheet of triangles that end on its outline.

        Parameters
        ----------
        spacing : float
            Side of the triangles, in `unit`.
        region : (2, 2) array_like, optional
            Lower and upper (u, v) of the part wanted; the whole outline by default.

        Raises
        ------
        ReconstructionError
            If the region contains nothing of the blade, or the triangles would be wider than it.
        """
        width = float(np.ptp(self.outline.bounds, axis=0).min())
        if require_positive(spacing, "spacing") > width:
            raise ReconstructionError(
                f"spacing: is {spacing:.4g}, where the blade is {width:.4g} wide; give a finer one"
            )
        plane, triangles = triangulate(self.outline.polygon, spacing, region)
        return build_mesh(self.lift(np.column_stack([plane, np.zeros(len(plane))])), triangles)

    def describe(self) -> dict[str, Any]:
        """Return what a summary says of the blade, as plain values, by headings."""
        counts = self.surface.cover.counts
        along, across = np.ptp(self.outline.bounds, axis=0).tolist()
        return {
            "chart": {"length": along, "width": across, "rim_radius": self.rim_radius, "notes": list(self.notes)},
            "outline": {"area_in_the_plane": self.outline.area},
            "surface": {
                "balls": len(counts),
                "points_per_ball": [int(counts.min()), int(counts.max())],
                "smoothing": self.surface.local.smoothing.value,
            },
        }
