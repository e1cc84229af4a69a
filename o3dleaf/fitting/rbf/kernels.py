"""Polyharmonic kernels: each one carries its mathematics (sign, order, least degree, θ)."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FARTHEST, FloatArray
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.errors import IllPosedError, InputError
from o3dleaf.fitting.rbf.shaped.shaped_kernels import PROFILES, Shaped, as_shaped

NAMES = {"linear": 1, "thin_plate_spline": 2, "cubic": 3, "quintic": 5}
"""SciPy's names of the scale-free kernels, with the power of r; an even power carries a logarithm."""


@dataclass(frozen=True)
class Polyharmonic:
    r"""The radial function φ(r) = ±rᵏ (k odd) or ±rᵏ log r (k even) on d-dimensional points.

    The sign makes φ conditionally positive definite: −r, r² log r, r³, −r⁴ log r, −r⁵.

    Attributes
    ----------
    power : int
        The exponent k.
    dimension : int
        The dimension d of the points.
    """

    power: int
    dimension: int

    def __str__(self) -> str:
        """Return the radial part without its sign."""
        return f"r^{self.power}" + (" log r" if self.logarithmic else "")

    @property
    def logarithmic(self) -> bool:
        """True where φ carries log r (even powers do; without it they would be polynomials)."""
        return self.power % 2 == 0

    @property
    def sign(self) -> float:
        """The sign of φ, ±1."""
        half = self.power // 2 + 1
        return float((-1) ** half)

    @property
    def order(self) -> int:
        """Order of conditional positive definiteness: ⌊k/2⌋ + 1 (Wendland 2005, theorems 8.16 and 8.17)."""
        return self.power // 2 + 1

    @property
    def least_degree(self) -> int:
        """The least degree of the polynomial tail for which the interpolant is unique: order − 1."""
        return self.order - 1

    @property
    def m(self) -> int | None:
        """Order m of the thin-plate energy that φ minimizes, 2m − d = k, or None where there is none."""
        twice = self.power + self.dimension
        return None if twice % 2 else twice // 2

    @property
    def degree(self) -> int:
        """The usual degree of the tail: m − 1, the null space of the energy, or else the least degree."""
        return self.least_degree if self.m is None else self.m - 1

    @property
    def theta(self) -> float | None:
        r"""The constant |θ| of the polyharmonic spline (paper, equation of E(τ)), or None without m.

        .. math:: θ = \frac{1}{2^{2m-1} π^{d/2} (m-1)!\,(m-d/2)!} \quad (2m-d \text{ even}), \qquad
                  θ = \frac{|Γ(d/2-m)|}{2^{2m} π^{d/2} (m-1)!} \quad \text{otherwise.}

        1/θ is 8π for r² log r in 2-D and 96π for r³ in 3-D.
        """
        return None if self.m is None else self._fourier_constant

    def smoothing_for(self, bandwidth: float, density: float) -> float:
        r"""Return the smoothing whose low-pass filter has the given bandwidth: s = density · hᵏ⁺ᵈ/θ.

        On dense data the smoothed fit passes frequencies ω with :math:`1/(1 + (h|ω|)^{2m})`, 2m = k + d;
        the constant θ has a meaning for this in every dimension (Wahba 1990, section 2.4).

        Parameters
        ----------
        bandwidth : float
            h, in the unit of the points.
        density : float
            Points per unit of volume (of area in 2-D).
        """
        return density * bandwidth ** (self.power + self.dimension) / self._fourier_constant

    @property
    def _fourier_constant(self) -> float:
        """The constant c with φ̂(ω) = ±1/(c |ω|²ᵐ), 2m = k + d, also where m is no whole number."""
        m, half = (self.power + self.dimension) / 2, self.power / 2
        common: float = 4.0**m * math.pi ** (self.dimension / 2) * math.gamma(m)
        return 2 / (common * math.gamma(half + 1)) if self.logarithmic else abs(math.gamma(-half)) / common

    def __call__(self, r: npt.ArrayLike) -> FloatArray:
        """Return φ(r) for distances `r` >= 0 of any shape; 0 at r = 0."""
        radius = np.asarray(r, dtype=np.float64)
        value = self.sign * radius**self.power
        return value * np.log(np.where(radius > 0, radius, 1.0)) if self.logarithmic else value


@checked
def polyharmonic(m: int, d: int) -> Polyharmonic:
    """Return the polyharmonic spline of order m in d dimensions, φ = ±r^(2m−d) [log r if 2m − d is even].

    Parameters
    ----------
    m : int
        Order of the thin-plate energy, equation (1) of the paper; 2m > d.
    d : int
        Dimension of the points.

    Raises
    ------
    InputError
        If 2m − d is not positive: point values then have no meaning in the energy's space.
    """
    if d < 1 or 2 * m <= d:
        raise InputError(f"m, d: are {m}, {d}; a polyharmonic spline needs d >= 1 and 2m > d")
    return Polyharmonic(2 * m - d, d)


def as_kernel(kernel: str | Polyharmonic, dimension: int) -> Polyharmonic:
    """Return the kernel object of a SciPy name ('linear', 'thin_plate_spline', 'cubic', 'quintic') or of itself.

    Raises
    ------
    InputError
        If the name is unknown, or the kernel has a shape or belongs to another dimension.
    """
    if isinstance(kernel, Shaped) or (isinstance(kernel, str) and kernel in PROFILES):
        name = kernel.name if isinstance(kernel, Shaped) else kernel
        raise InputError(f"kernel: {name!r} is for RBFInterpolant only; choose one of {', '.join(NAMES)} here")
    if isinstance(kernel, str):
        return Polyharmonic(NAMES[require_choice(kernel, NAMES, "kernel")], dimension)
    if kernel.dimension != dimension:
        raise InputError(
            f"kernel: is for {kernel.dimension}-D points, these are {dimension}-D; use polyharmonic(m, {dimension})"
        )
    return kernel


def as_any_kernel(
    kernel: str | Polyharmonic | Shaped, dimension: int, epsilon: float | None
) -> tuple[Polyharmonic | Shaped, float]:
    """Return the kernel object of any SciPy name or of itself, and the ε that the distance is multiplied with.

    That is 1 of a kernel whose shape has no scale, unless another one is given.

    Raises
    ------
    InputError
        If the name is unknown, ε is missing, not above 0 or given twice, or the kernel belongs to another dimension.
    """
    if isinstance(kernel, str) and kernel in PROFILES:
        shaped = as_shaped(kernel, dimension, epsilon)
        return shaped, shaped.epsilon
    if isinstance(kernel, Shaped):
        if epsilon is not None and epsilon != kernel.epsilon:
            raise InputError(f"epsilon: is {epsilon:g}, and the kernel has {kernel.epsilon:g}; give one of them")
        if kernel.dimension != dimension:
            raise InputError(f"kernel: is for {kernel.dimension}-D points, these are {dimension}-D; give its name")
        return kernel, kernel.epsilon
    require_choice(kernel, (*NAMES, *PROFILES), "kernel") if isinstance(kernel, str) else None
    return as_kernel(kernel, dimension), 1.0 if epsilon is None else require_positive(
        epsilon, "epsilon", largest=FARTHEST
    )


def as_degree(degree: int | None, kernel: Polyharmonic | Shaped, *, or_none: bool = False) -> int:
    """Return the degree of the tail, by default the kernel's own, or raise `InputError` or `IllPosedError`.

    With `or_none`, −1 is the degree of no tail, also for kernels that need one.
    """
    if degree is None:
        return kernel.degree
    if not isinstance(degree, int | np.integer):
        raise InputError(f"degree: is {degree!r}; give a whole number")
    if degree < kernel.least_degree and not (or_none and degree == -1):
        raise IllPosedError(f"degree: is {degree}; this kernel needs at least {kernel.least_degree}")
    return int(degree)


def require_twice_differentiable(kernel: Polyharmonic | Shaped) -> None:
    """Raise `InputError` for φ = −r and r² log r, which have no second derivatives at their data."""
    if isinstance(kernel, Polyharmonic) and kernel.power < 3:
        raise InputError(f"hessian: {kernel} has no second derivatives at its data; use 'cubic' or a smoother kernel")
