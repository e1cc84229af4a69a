"""The partition of unity takes any local fit that speaks Field: here, plain least-squares quadratics.

python scripts/03_other_local_fits.py
"""

import numpy as np

import o3dleaf as o3l


class Quadratic:
    """A quadratic in two variables, fitted by least squares."""

    unit = None

    def __init__(self, points, values):
        self.bounds = np.array([points.min(axis=0), points.max(axis=0)])
        self.centre = points.mean(axis=0)
        self.coefficients = np.linalg.lstsq(self.terms(points), values, rcond=None)[0]

    def terms(self, points):
        x, y = (points - self.centre).T
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)

    def __call__(self, points):
        return self.terms(points) @ self.coefficients

    def gradient(self, points):
        x, y = (points - self.centre).T
        one, zero = np.ones_like(x), np.zeros_like(x)
        along_x = np.stack([zero, one, zero, 2 * x, y, zero], axis=1) @ self.coefficients
        along_y = np.stack([zero, zero, one, zero, x, 2 * y], axis=1) @ self.coefficients
        return np.stack([along_x, along_y], axis=1)


def main(seed=0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 1, (4000, 2))
    values = np.sin(6 * points[:, 0]) * np.cos(5 * points[:, 1]) + 0.05 * rng.normal(size=4000)
    queries = rng.uniform(0, 1, (2000, 2))
    truth = np.sin(6 * queries[:, 0]) * np.cos(5 * queries[:, 1])
    fits = {
        "r^3, smoothing by GCV": o3l.PUInterpolant.fit(points, values, smoothing="gcv"),
        "local quadratics": o3l.PUInterpolant.fit(points, values, local=Quadratic, points_per_ball=80),
    }
    return {name: float(np.sqrt(np.mean((fit(queries) - truth) ** 2))) for name, fit in fits.items()}


if __name__ == "__main__":
    for name, error in main().items():
        print(f"{name:>24}: RMS error {error:.4f} at noise 0.05")
