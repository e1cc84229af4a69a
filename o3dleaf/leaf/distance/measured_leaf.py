"""A leaf that can be measured: distances to its surface, projection onto it, normals, curvature, grids of them."""

from functools import cached_property
from os import PathLike

import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.distance.distance import SurfaceIndex
from o3dleaf.leaf.distance.grid import Sampler, mask_sampler, plan_grid, write_grid
from o3dleaf.leaf.distance.projection import mean_curvature, normals, project
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.leaf.textured_blade import TexturedBlade


class MeasuredLeaf(TexturedBlade):
    """A texture on a blade, with the indices that find closest points of its surface."""

    @cached_property
    def surface_index(self) -> SurfaceIndex:
        """Index of the surface, pockets and islands too; see `index_of`."""
        return self._build_index(closed=False)

    @cached_property
    def solid_index(self) -> SurfaceIndex:
        """Index of the closed solid's surface."""
        return self._build_index(closed=True)

    def index_of(self, *, closed: bool = False) -> SurfaceIndex:
        """Return the index that finds closest points of the surface, made when it is first asked for and kept.

        Raises
        ------
        InputError
            If several patches are blended along the leaf.
        """
        return self.solid_index if closed else self.surface_index

    def _build_index(self, *, closed: bool) -> SurfaceIndex:
        if not (self.is_one_tile or isinstance(self.texture, WangField | ThinnedField)):
            raise InputError(
                "texture: several patches along the leaf have no single tile to measure to; extract a mesh and use "
                "Open3D's RaycastingScene"
            )
        return SurfaceIndex.build(self, closed=closed)

    @checked
    def signed_distance(self, x: npt.ArrayLike, *, closed: bool = False) -> FloatArray:
        """Return the (n,) distances of (n, 3) world points to the leaf's surface, in `unit`; negative inside.

        The leaf is where G > 0 and (along, across) is in the outline: its surface is the two faces with their
        hairs, the rim, and the walls of the air pockets, which are outside. At every finite point it is finite; to
        the surface's samples it is a true minimum, and beside the nearest of them Newton's method finds the foot.
        Beside a tapered rim, and most at its corners, samples are far apart, and it may be too large by up to their
        spacing where Newton's method finds none.

        Parameters
        ----------
        x : (n, 3) array_like
        closed : bool
            True: to the solid that ``extract_mesh(closed=True)`` draws and a droplet meets: the outline is rounded,
            air that the blade encloses is leaf, and islands beside it are not. Half the distance of the data is the
            step at which enclosed air is distinguished from the rest.

        Raises
        ------
        InputError
            If several patches are blended along the leaf.
        ReconstructionError
            If it is to be closed, and air reaches through the blade.
        """
        return self.index_of(closed=closed).signed_distance(x)

    @checked
    def closest_points(self, x: npt.ArrayLike, *, closed: bool = False) -> FloatArray:
        """Return the (n, 3) points of the leaf's surface that `signed_distance` measures to."""
        return self.index_of(closed=closed).closest_points(x)

    def project(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n, 3) points of the surface G = 0 that Newton's method along the gradient reaches from x.

        .. math:: x ← x - λ\,G(x)\,∇G(x)/|∇G(x)|²

        with steps halved until \|G\| falls. Where that ends in a place without a surface - far away, in the
        air between hairs, in the middle of the blade - the result is the closest point of the leaf instead, as in
        `closest_points`. Otherwise the outline has no effect here: the surface goes on past the rim.
        """
        return project(self, x, self.closest_points)

    def normals(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) outward unit normals −∇G/|∇G| of the level sets of G at world points; 0 where ∇G is."""
        return normals(self, x)

    def mean_curvature(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n,) mean curvatures of the level sets of G at world points, in 1/`unit`.

        .. math:: κ = \tfrac{1}{2}\,∇·n, \qquad n = -∇G/|∇G|

        Positive where the leaf bulges: 1/R on a sphere of radius R, 1/2R on a cylinder. The texture's second
        derivatives are analytic; those of the blade are central differences of its analytic Jacobian, and jump with
        the frame's at the control points of a cubic midrib.
        """
        return mean_curvature(self, x)

    @checked
    def write_grid(
        self,
        path: str | PathLike[str],
        spacing: float | npt.ArrayLike,
        bounds: npt.ArrayLike | None = None,
        *,
        what: str = "field",
        closed: bool = False,
    ) -> None:
        """Sample the leaf at the whole multiples of `spacing` in a box of the world, into one file.

        The file appears whole or not at all, and is written slab by slab: memory does not grow with the grid.

        Parameters
        ----------
        path : path-like
            VTK ImageData (.vti) or NRRD (.nrrd), x fastest, little endian; origin, spacing and unit are in it.
        spacing : float or (3,) array_like
            Step, in `unit`.
        bounds : (2, 3) array_like, optional
            Lower, then upper corner, in `unit`; the leaf's own by default.
        what : {"field", "distance", "mask"}
            G (float32), the signed distance (float32), or 1 in the leaf and 0 outside it (uint8).
        closed : bool
            Of distance and mask: that of the closed solid, as in `signed_distance`.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder cannot be written to, or several patches are blended along the leaf
            and distances are requested.
        O3DLeafError
            If the disk has no room for the grid.
        """
        grid = plan_grid(path, spacing, self.bounds if bounds is None else bounds, what, self.unit)
        write_grid(grid, self._sampler(what, closed=closed))

    def _sampler(self, what: str, *, closed: bool) -> Sampler:
        if what == "field":
            return self
        if what == "distance":
            return self.index_of(closed=closed).signed_distance
        outline = self.edge_curve(closed=False)
        return mask_sampler(self, self.solid_index.solid if closed else LeafSolid(outline, ()))
