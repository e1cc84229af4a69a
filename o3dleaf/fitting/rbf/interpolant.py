"""The single interpolant: one sum of kernels and tail through all the data, the paper's equation (2)."""

from dataclasses import dataclass, field
from os import PathLike

import numpy as np
import numpy.typing as npt

from o3dleaf.core import journal
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import SmoothingValue, Unit
from o3dleaf.core.checks.arrays import FARTHEST, FloatArray
from o3dleaf.core.checks.attributes import as_values, as_weights, warn_of_contradictions
from o3dleaf.core.checks.coordinates import as_points, as_sites, require_reach
from o3dleaf.core.errors import DataWarning, IllPosedError
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.core.units import check_unit
from o3dleaf.fitting.rbf import evaluation_loops
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_any_kernel, as_degree, require_twice_differentiable
from o3dleaf.fitting.rbf.shaped.dense_system import DenseSystem, as_rows_of
from o3dleaf.fitting.rbf.shaped.shaped_kernels import Shaped
from o3dleaf.fitting.rbf.shaped.shaped_loops import evaluate_shaped
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, as_smoothing
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents
from o3dleaf.io.models.model_file import write_model

BLOCK = 512


@dataclass(frozen=True, eq=False)
class RBFInterpolant:
    r"""A (smoothed) polyharmonic spline, or a sum of other kernels, through scattered values, by one dense system.

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
    kernel : Polyharmonic or Shaped
    smoothing : Smoothing
        With its value, chosen where it was "gcv".
    center, radius : (d,) ndarray, float
        The ball around the data in whose unit coordinates (x − center)/radius everything is stored.
    points, weights : (d, n), (n,) or (m, n) ndarrays
        Data sites in unit coordinates, and λ, for m columns of values a row each.
    tail, exponents : (q,) or (m, q), (q, d) ndarrays
        The a_k, and the exponents of the p_k.
    """

    kernel: Polyharmonic | Shaped
    smoothing: Smoothing
    bounds: FloatArray
    unit: str | None
    center: FloatArray = field(metadata={"stored": "centre"})
    radius: float
    points: FloatArray
    weights: FloatArray
    tail: FloatArray
    exponents: IntArray

    def __repr__(self) -> str:
        unit = f", unit {self.unit}" if self.unit else ""
        return f"RBFInterpolant({self.kernel.dimension}-D, {self.points.shape[1]:,} points, {self.kernel}{unit})"

    @property
    def columns(self) -> int | None:
        """m, the number of columns of values, or None where a point has one number."""
        return None if self.weights.ndim == 1 else len(self.weights)

    @classmethod
    @checked
    def fit(
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        kernel: str | Polyharmonic | Shaped = "cubic",
        epsilon: float | None = None,
        degree: int | None = None,
        smoothing: SmoothingValue | None = None,
        rho: SmoothingValue | None = None,
        weights: npt.ArrayLike | None = None,
        unit: Unit | None = None,
    ) -> "RBFInterpolant":
        """Fit the spline to `values` at `points`.

        Parameters
        ----------
        points : (n, d) array_like
            Data sites, in `unit`; distinct where nothing is smoothed.
        values : (n,) or (n, m) array_like
            One number a point, or m of them: one fit for each column, with one factorization.
        kernel : str, Polyharmonic or Shaped
            A kernel object, or one of SciPy's names: "linear", "thin_plate_spline", "cubic", "quintic", and with
            `epsilon` "gaussian", "multiquadric", "inverse_multiquadric" and "inverse_quadratic" (`Shaped`).
        epsilon : float, optional
            ε above 0: φ is taken of εr, as in SciPy. Kernels that have a shape need it; of the others it only
            divides `smoothing` by εᵏ, k the power of φ.
        degree : int, optional
            Total degree of the tail; by default the null space of the kernel's energy, m − 1, or 0 of a kernel with a
            shape. −1 is no tail, as in SciPy: of a kernel that needs one the system may then be singular, and
            "gcv" has no meaning.
        smoothing : float or "gcv", optional
            The number s on the diagonal, as in SciPy; 0 by default. "gcv" takes what `choose_by_gcv` says.
        rho : float or "gcv", optional
            The paper's ρ instead: s = ρ n/θ.
        weights : (n,) array_like, optional
            Above 0: point j gets s divided by its weight.
        unit : str, optional
            Unit of length of the points.

        Raises
        ------
        InputError
            If the input has a wrong shape or is not finite, or an option makes no sense.
        IllPosedError
            If the points cannot determine the tail of the degree that was requested, or the degree
            is below what the kernel needs, or −1 and the system is singular.

        Warns
        -----
        DataWarning
            If the points cannot determine the usual tail, or coincide with different values where nothing is smoothed.
        """
        sites = as_sites(points, "points", least=1, largest=FARTHEST)
        data = as_values(values, len(sites), columns=True)
        point_weights = np.ones(len(sites)) if weights is None else as_weights(weights, len(sites))
        phi, scale = as_any_kernel(kernel, sites.shape[1], epsilon)
        asked = as_degree(degree, phi, or_none=True)
        bounds = np.array([sites.min(axis=0), sites.max(axis=0)])
        center, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2 or 1.0
        if asked < phi.least_degree:
            # Without the tail that it needs a kernel is another one in another unit: log(εr) is not log r.
            radius = 1 / scale
        local = np.ascontiguousarray(((sites - center) / radius).T)
        chosen = as_smoothing(phi, smoothing, rho)
        # ρ is of φ(r), whatever ε.
        system = DenseSystem(phi, tail_exponents(sites.shape[1], asked), radius if rho is not None else scale * radius)
        with single_threaded_blas():
            if isinstance(chosen.value, str):
                eigenvalues, rows = system.spectra(local, as_rows_of(data), np.sqrt(point_weights))
                eigenvalues /= chosen.scale(len(sites)) * system.unit_scale
                chosen = chosen.chosen(Spectrum.pooled(Spectrum(eigenvalues, each, len(sites)) for each in rows))
            diagonal = chosen.diagonal(len(sites)) * system.unit_scale / point_weights
            coefficients, tail, rank = system.solve(local, data, diagonal)
        exponents = system.exponents
        if rank < len(exponents):
            open_terms = (
                f"degree: the {len(sites)} points determine rank {rank} of the {len(exponents)} terms of degree {asked}"
            )
            if degree is not None:
                raise IllPosedError(f"{open_terms}; lower the degree or add points off their common plane or curve")
            journal.warn(
                f"{open_terms}: off their common plane or curve the function is a guess; add points there",
                DataWarning,
            )
        if chosen.value == 0:
            warn_of_contradictions(sites, data)
        return cls(phi, chosen, bounds, check_unit(unit), center, radius, local, coefficients, tail, exponents)

    @checked
    def save(self, path: str | PathLike[str]) -> None:
        """Write the interpolant as one model file, which `o3dleaf.load` reads."""
        write_model(self, path)

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values of the spline, or (n, m) of its columns, at (n, d) points."""
        return np.ascontiguousarray(self._jets(points, 0)[..., 0])

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, d) gradients of the spline, or (n, m, d), at (n, d) points, in value per `unit`."""
        return np.ascontiguousarray(self._jets(points, 1)[..., 1:]) / self.radius

    def hessian(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, d, d) second derivatives, or (n, m, d, d), at (n, d) points, in value per `unit` squared.

        Raises
        ------
        InputError
            If the kernel is not twice differentiable: φ = −r and r² log r are not.
        """
        require_twice_differentiable(self.kernel)
        dimension = self.kernel.dimension
        jets = self._jets(points, 2)
        hessians = np.empty((*jets.shape[:-1], dimension, dimension))
        a, b = np.triu_indices(dimension)
        hessians[..., a, b] = hessians[..., b, a] = jets[..., 1 + dimension :] / self.radius**2
        return hessians

    def _jets(self, points: npt.ArrayLike, level: int) -> FloatArray:
        """Return the jets, in unit coordinates, at (n, d) points, (n, ·) or (n, m, ·); see `evaluation_loops`."""
        dimension = self.kernel.dimension
        places = as_points(points, dim=dimension)
        with np.errstate(over="ignore"):
            local = require_reach((places - self.center) / self.radius, "points")
        queries = np.ascontiguousarray(local.T)
        weights, tails = (np.ascontiguousarray(np.atleast_2d(part)) for part in (self.weights, self.tail))
        jets = np.empty((len(weights), evaluation_loops.jet_size(dimension, level), queries.shape[1]))

        def task(start: int, stop: int) -> None:
            if isinstance(self.kernel, Shaped):
                shape = self.kernel.epsilon * self.radius
                sums = (self.points, weights, tails, self.exponents)
                evaluate_shaped(start, stop, queries, *sums, self.kernel.profile, shape, level, jets)
                return
            for column, part in enumerate(jets):
                model = (self.points, weights[column], tails[column], self.exponents, self.kernel.power)
                evaluation_loops.evaluate(start, stop, queries, *model, level, part)

        run_blocks(task, queries.shape[1], BLOCK)
        return jets[0].T if self.weights.ndim == 1 else np.moveaxis(jets, 2, 0)
