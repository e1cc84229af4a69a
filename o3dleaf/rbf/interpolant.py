"""The single interpolant: one polyharmonic spline through all the data, the paper's equation (2)."""

from dataclasses import dataclass
from os import PathLike

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, as_points, as_values, as_weights
from o3dleaf.errors import IllPosedError
from o3dleaf.parallel import run_blocks, single_threaded_blas
from o3dleaf.rbf import loops, solve, spectrum
from o3dleaf.rbf.kernels import Polyharmonic, as_kernel
from o3dleaf.rbf.smoothing import Amount, Smoothing, Spectrum, as_smoothing
from o3dleaf.rbf.tail import IntArray, tail_exponents
from o3dleaf.store import write_model
from o3dleaf.units import check_unit

BLOCK = 512


@dataclass(frozen=True, eq=False)
class RBFInterpolant:
    r"""A (smoothed) polyharmonic spline through scattered values, with one dense system.

    .. math:: F(x) = \sum_j λ_j φ(|x - x_j|) + \sum_k a_k p_k(x), \qquad
              (A + s I) λ + P a = f, \quad P^T λ = 0

    Memory is n² numbers and time n³/3 operations: for more than a few thousand points use
    `PUInterpolant`. Built by `fit`; always fitted. Unlike fields that are blended of balls, it
    extrapolates outside `bounds` as the formula says.

    Attributes
    ----------
    bounds : (2, d) ndarray
        Bounding box of the data, in `unit`.
    unit : str or None
        Unit of length of the points.
    kernel : Polyharmonic
    smoothing : Smoothing
        The rule for s with its amount, chosen where it was "gcv".
    centre, radius : (d,) ndarray, float
        The ball around the data in whose unit coordinates (x − centre)/radius everything is stored.
    points, weights : (d, n), (n,) ndarrays
        Data sites in unit coordinates, and λ.
    tail, exponents : (q,), (q, d) ndarrays
        The a_k, and the exponents of the p_k.
    """

    kernel: Polyharmonic
    smoothing: Smoothing
    bounds: FloatArray
    unit: str | None
    centre: FloatArray
    radius: float
    points: FloatArray
    weights: FloatArray
    tail: FloatArray
    exponents: IntArray

    @classmethod
    def fit(
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        kernel: str | Polyharmonic = "cubic",
        degree: int | None = None,
        smoothing: Amount | None = None,
        rho: Amount | None = None,
        weights: npt.ArrayLike | None = None,
        unit: str | None = None,
    ) -> "RBFInterpolant":
        """Fit the spline to `values` at `points`.

        Parameters
        ----------
        points : (n, d) array_like
            Data sites, in `unit`; distinct where nothing is smoothed.
        values : (n,) array_like
        kernel : str or Polyharmonic
            A kernel object, or one of SciPy's names.
        degree : int, optional
            Total degree of the tail; by default the null space of the kernel's energy, m − 1.
        smoothing : float or "gcv", optional
            The number s on the diagonal, as in SciPy; 0 by default. "gcv" takes what `choose_by_gcv` says.
        rho : float or "gcv", optional
            The paper's ρ instead: s = ρ n/θ.
        weights : (n,) array_like, optional
            How far each value is to be trusted, above 0: point j gets s divided by its weight.
        unit : str, optional
            Unit of length of the points.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite.
        IllPosedError
            If the points cannot determine the tail of the degree that was asked for, or the degree
            is below what the kernel needs.
        """
        sites = as_points(points, least=1)
        data = as_values(values, len(sites))
        trust = np.ones(len(sites)) if weights is None else as_weights(weights, len(sites))
        phi = as_kernel(kernel, sites.shape[1])
        asked = phi.degree if degree is None else degree
        if asked < phi.least_degree:
            raise IllPosedError(f"degree: is {asked}; this kernel needs at least {phi.least_degree}")
        exponents = tail_exponents(sites.shape[1], asked)
        bounds = np.array([sites.min(axis=0), sites.max(axis=0)])
        centre, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2 or 1.0
        local = np.ascontiguousarray(((sites - centre) / radius).T)
        rule = as_smoothing(phi, smoothing, rho)
        unit_scale = 1 / radius**phi.power
        with single_threaded_blas():
            if isinstance(rule.amount, str):
                found, coefficients = spectrum.spectrum(local, data, np.sqrt(trust), exponents, phi.power)
                scale = rule.scale(len(sites)) * unit_scale
                rule = rule.chosen(Spectrum(found / scale, coefficients, len(sites)))
            diagonal = rule.diagonal(len(sites)) * unit_scale / trust
            strengths, tail, rank, _ = solve.solve_local(local, data, exponents, phi.power, diagonal)
        if rank < len(exponents) and degree is not None:
            raise IllPosedError(
                f"degree: the {len(sites)} points determine rank {rank} of the {len(exponents)} terms of degree "
                f"{asked}; lower the degree or add points off their common plane or curve"
            )
        return cls(phi, rule, bounds, check_unit(unit), centre, radius, local, strengths, tail, exponents)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the interpolant as one model file, which `o3dleaf.load` reads."""
        write_model(path, self)

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values of the spline at (n, d) points."""
        return self._evaluate(points, with_gradient=False)[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, d) gradients of the spline at (n, d) points, in value per `unit`."""
        return self._evaluate(points, with_gradient=True)[1] / self.radius

    def _evaluate(self, points: npt.ArrayLike, *, with_gradient: bool) -> tuple[FloatArray, FloatArray]:
        dimension = self.kernel.dimension
        queries = np.ascontiguousarray((as_points(points, dim=dimension) - self.centre) / self.radius)
        values = np.empty(len(queries))
        gradients = np.empty((len(queries) if with_gradient else 0, dimension))
        model = (self.points, self.weights, self.tail, self.exponents, self.kernel.power)

        def task(start: int, stop: int) -> None:
            loops.evaluate(start, stop, queries, *model, values, gradients)

        run_blocks(task, len(queries), BLOCK)
        return values, gradients
