"""The height map H: the blade's height over its flattened plane, a smoothed explicit fit (paper, section 2.4)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Order, SmoothingValue, Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points, as_sites
from o3dleaf.fitting.cover.cover import as_ball_size
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL
from o3dleaf.fitting.pu.interpolant import OVERLAP, PUInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_kernel
from o3dleaf.leaf.macro.robust import RobustChoice, choose_robustly, choose_with_balls

KERNEL = "cubic"


@dataclass(frozen=True, eq=False)
class HeightMap:
    r"""A smooth function H with H(y₁, y₂) ≈ y₃ for the scan in leaf coordinates.

    Outside the scan's bounding box, H keeps the value of the nearest point of the box.

    Attributes
    ----------
    interpolant : PUInterpolant
        In two dimensions, (along, across).
    choice : RobustChoice or None
        Smoothing and weights of the robust fit, where it was requested.
    """

    interpolant: PUInterpolant
    choice: RobustChoice | None = None

    @classmethod
    @checked
    def fit(
        cls,
        leaf_points: npt.ArrayLike,
        *,
        kernel: str | Polyharmonic = KERNEL,
        smoothing: SmoothingValue | Literal["robust"] | None = None,
        rho: SmoothingValue | None = None,
        points_per_ball: tuple[Count, Count] = POINTS_PER_BALL,
        overlap: float = OVERLAP,
        unit: Unit | None = None,
    ) -> "HeightMap":
        """Fit H to the scan in leaf coordinates.

        Parameters
        ----------
        leaf_points : (n, 3) array_like
            (along, across, up) of the scan, in `unit`.
        kernel : str or Polyharmonic
            r³ by default: C² at its data and fast. The paper's is "thin_plate_spline", r² log r.
        smoothing : "robust", float or "gcv", optional
            "robust", the default where `rho` is not given, follows the majority of the scan's passes
            and judges the smoothing on held-out stretches of the leaf; see `choose_robustly`. A number
            or "gcv" means plain least squares, as in `PUInterpolant.fit`.
        rho : float or "gcv", optional
            The paper's ρ instead; its figures are ``kernel="thin_plate_spline", rho=400`` in µm.
        points_per_ball, overlap, unit
            As in `PUInterpolant.fit`.

        Raises
        ------
        InputError
            If there are too few points or they are not finite.
        """
        points = as_sites(leaf_points, "leaf_points", dim=3, least=3)
        plane, heights = np.ascontiguousarray(points[:, :2]), np.ascontiguousarray(points[:, 2])
        phi, choice, weights = as_kernel(kernel, 2), None, None
        points_per_ball = as_ball_size(points_per_ball, overlap)
        is_robust = smoothing == "robust" or (smoothing is None and rho is None)
        value = None if smoothing == "robust" else smoothing
        choosing, fitting = progress.split(20 if is_robust else 0, 1)
        with choosing:
            if is_robust:
                points_per_ball, choice = choose_with_balls(points, phi, points_per_ball, overlap, choose_robustly)
                value, weights = choice.smoothing, choice.weights
        with fitting:
            interpolant = PUInterpolant.fit(
                plane,
                heights,
                kernel=phi,
                degree=1,
                smoothing=value,
                rho=rho,
                weights=weights,
                points_per_ball=points_per_ball,
                overlap=overlap,
                unit=unit,
            )
        return cls(interpolant, choice)

    def __repr__(self) -> str:
        return f"HeightMap({self.interpolant!r})"

    @property
    def unit(self) -> str | None:
        """Unit of length of the plane and of the heights."""
        return self.interpolant.unit

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) box of the scan in the plane."""
        return self.interpolant.bounds

    def __call__(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n,) heights at (n, 2) points (along, across)."""
        return self.interpolant(np.clip(as_points(plane, dim=2), *self.bounds))

    def gradient(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n, 2) gradients ∂H/∂(along, across); 0 across the edge of the box, where H is constant."""
        points = as_points(plane, dim=2)
        inside = np.clip(points, *self.bounds)
        return np.where(points == inside, self.interpolant.gradient(inside), 0.0)

    @checked
    def jet(self, plane: npt.ArrayLike, order: Order = 2) -> FloatArray:
        """Return H, H₁, H₂ and, for order 2, H₁₁, H₁₂, H₂₂ at (n, 2) points, (n, 3) or (n, 6).

        Raises
        ------
        InputError
            If second derivatives are requested and the kernel has none: r² log r, the paper's, has not.
        """
        points = as_points(plane, dim=2)
        inside = np.clip(points, *self.bounds)
        parts = self.interpolant.jets(inside, order)
        free = points == inside
        columns = [parts[0], *(np.where(free, parts[1], 0.0).T if order else ())]
        if order == 2:
            columns += [np.where(free[:, a] & free[:, b], parts[2][:, a, b], 0.0) for a, b in ((0, 0), (0, 1), (1, 1))]
        return np.stack(columns, axis=1)
