"""The physics of an impact in SI, and in the units that the solver runs in: 10 µm, 10 µs and 1e-10 kg."""

import math
from dataclasses import dataclass, replace

from o3dleaf.core.arguments.kinds import Positive

LENGTH, TIME, MASS = 1e-5, 1e-5, 1e-10
"""The solver's units in SI. Speeds and surface tension have the same numbers in both; in meters, interFoam ends in its
first step with a floating point exception on every mesh that was snapped to cells of micrometers."""


@dataclass(frozen=True)
class Impact:
    """A droplet that hits a surface.

    Attributes
    ----------
    diameter : float
        In m.
    speed : float
        In m/s, against the surface's normal.
    angle : float
        The static contact angle, in degrees.
    gravity : (float, float, float)
        In the surface's frame, in m/s².
    density, gas_density : float
        In kg/m³: water and air at 20 °C, like what follows.
    viscosity, gas_viscosity : float
        Kinematic, in m²/s.
    tension : float
        In N/m.
    """

    diameter: Positive = 0.6e-3
    speed: Positive = 0.5
    angle: Positive = 150.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    density: Positive = 998.2
    gas_density: Positive = 1.204
    viscosity: Positive = 1.004e-6
    gas_viscosity: Positive = 1.516e-5
    tension: Positive = 0.0728

    def scaled(self) -> "Impact":
        """Return the same with numbers in the solver's units."""
        x, y, z = self.gravity
        acceleration, density, viscosity = LENGTH / TIME**2, MASS / LENGTH**3, LENGTH**2 / TIME
        return replace(
            self,
            diameter=self.diameter / LENGTH,
            speed=self.speed / (LENGTH / TIME),
            gravity=(x / acceleration, y / acceleration, z / acceleration),
            density=self.density / density,
            gas_density=self.gas_density / density,
            viscosity=self.viscosity / viscosity,
            gas_viscosity=self.gas_viscosity / viscosity,
            tension=self.tension / (MASS / TIME**2),
        )

    @property
    def weber(self) -> float:
        """Inertia over surface tension, ρ D v² / σ."""
        return self.density * self.diameter * self.speed**2 / self.tension

    @property
    def reynolds(self) -> float:
        """Inertia over viscosity, D v / ν."""
        return self.diameter * self.speed / self.viscosity

    @property
    def bond(self) -> float:
        """Weight over surface tension, ρ g D² / σ."""
        return self.density * math.hypot(*self.gravity) * self.diameter**2 / self.tension

    def capillary_step(self, cell: float) -> float:
        """Return the largest step at which capillary waves as long as a cell are stable, √((ρ + ρ_gas) h³ / 4πσ).

        References
        ----------
        Brackbill, Kothe and Zemach (1992), A continuum method for modeling surface tension, equation 61.
        """
        return math.sqrt((self.density + self.gas_density) * cell**3 / (4 * math.pi * self.tension))
