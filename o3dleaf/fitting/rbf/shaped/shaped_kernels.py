"""Kernels of the scaled distance εr: each one carries its mathematics (sign, least degree, profile)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FARTHEST, FloatArray
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.errors import InputError

PROFILES = ("gaussian", "multiquadric", "inverse_multiquadric", "inverse_quadratic")
"""SciPy's names of the kernels that need ε, in the order of `shaped_loops.profile`."""


@dataclass(frozen=True)
class Shaped:
    r"""The radial function φ(εr) of one of SciPy's kernels with a shape parameter, on d-dimensional points.

    =====================  =========================  ===============
    name                   φ                          least degree
    =====================  =========================  ===============
    gaussian               exp(−(εr)²)                −1 (no tail)
    multiquadric           −√(1 + (εr)²)              0
    inverse_multiquadric   1/√(1 + (εr)²)             −1
    inverse_quadratic      1/(1 + (εr)²)              −1
    =====================  =========================  ===============

    The sign makes φ (conditionally) positive definite (Wendland 2005, theorems 6.10, 7.15 and 8.15), in every
    dimension. The flatter φ is beside the spacing of the points (ε small), the more exact for smooth values and the
    worse conditioned.

    Attributes
    ----------
    name : str
    epsilon : float
        ε, over the unit of length of the points.
    dimension : int
        The dimension d of the points.
    """

    name: str
    epsilon: float
    dimension: int

    def __post_init__(self) -> None:
        """Raise `InputError` for an unknown name, or an ε that is not above 0."""
        require_choice(self.name, PROFILES, "kernel")
        require_positive(self.epsilon, "epsilon", largest=FARTHEST)

    def __str__(self) -> str:
        return f"{self.name} of {self.epsilon:g} r"

    @property
    def profile(self) -> int:
        """The number by which compiled loops know it."""
        return PROFILES.index(self.name)

    @property
    def least_degree(self) -> int:
        """The least degree of the polynomial tail for which the interpolant is unique; −1: none."""
        return 0 if self.name == "multiquadric" else -1

    @property
    def degree(self) -> int:
        """The usual degree of the tail: 0, as in SciPy."""
        return 0

    @property
    def theta(self) -> None:
        """None: it minimizes no thin-plate energy."""
        return

    def __call__(self, r: npt.ArrayLike) -> FloatArray:
        """Return φ(εr) for distances `r` >= 0 of any shape."""
        square = (self.epsilon * np.asarray(r, dtype=np.float64)) ** 2
        if self.name == "gaussian":
            return np.asarray(np.exp(-square))
        power = {"multiquadric": 0.5, "inverse_multiquadric": -0.5, "inverse_quadratic": -1.0}[self.name]
        return np.asarray((-1.0 if power > 0 else 1.0) * (1 + square) ** power)


def as_shaped(name: str, dimension: int, epsilon: float | None) -> Shaped:
    """Return the kernel of one of `PROFILES`, or raise `InputError` where its ε is missing or not above 0."""
    if epsilon is None:
        raise InputError(f"epsilon: is missing, and {name!r} needs it; give about one over the spacing of the points")
    return Shaped(name, epsilon, dimension)
