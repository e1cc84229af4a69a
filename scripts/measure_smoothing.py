"""Measure how well the data choose their smoothing: the figures of docs/design/fitting/smoothing.md.

    python scripts/measure_smoothing.py [--quick]

First rules on simulated balls: the error at the points of the smoothing that a rule takes, over that of the
best. Every smoothing's score and error follow from one eigen-decomposition of a ball, so that nothing is
refitted. Then the rules of the package on the synthetic micro-CT volume, at the voxels and between them.
"""

import argparse
from dataclasses import dataclass
from itertools import product

import numpy as np

import o3dleaf as o3l
from o3dleaf.fitting.rbf.smoothing import Spectrum, choose_by_gcv
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import tail_exponents

KERNELS = [(2, 2, 1), (2, 3, 1), (3, 3, 2), (3, 1, 1)]
"""Dimension, power of r, degree of the tail."""
NOISE = (0.01, 0.03, 0.1, 0.3)
"""Of the truth's standard deviation."""
AMOUNTS = 240


def smooth(x, rng):
    return np.sin(2 * x + rng.uniform(0, 6, x.shape[1])).sum(axis=1)


def wavy(x, rng):
    return np.sin(6 * x @ direction(x.shape[1], rng) + rng.uniform(0, 6))


def stepped(x, rng):
    return np.tanh(15 * (x @ direction(x.shape[1], rng) - rng.uniform(-0.3, 0.3)))


def kinked(x, rng):
    return np.abs(x @ direction(x.shape[1], rng) - rng.uniform(-0.3, 0.3))


def rough(x, rng):
    """Two hundred waves, the shorter the weaker."""
    waves = np.array([direction(x.shape[1], rng) for _ in range(200)])
    rates = rng.uniform(1, 40, 200)
    return np.sin(rates * (x @ waves.T) + rng.uniform(0, 6, 200)) @ (rng.standard_normal(200) / rates)


def nothing(x, _):
    return np.zeros(len(x))


TRUTHS = (smooth, wavy, stepped, kinked, rough, nothing)


def direction(dimension, rng):
    v = rng.standard_normal(dimension)
    return v / np.linalg.norm(v)


def ball_points(count, dimension, rng):
    """Scattered in the unit ball."""
    points = rng.uniform(-1, 1, (8 * count, dimension))
    return points[np.linalg.norm(points, axis=1) <= 1][:count]


@dataclass
class Case:
    """Balls that share one amount of smoothing, seen on the null space of their tails."""

    eigenvalues: np.ndarray
    clean: np.ndarray
    unit: np.ndarray
    """Coefficients of the truth, and of noise of unit size."""
    count: int
    of_tail: float
    """Squares of the noise that the tails take up, whatever the smoothing."""

    @classmethod
    def of(cls, balls, power, degree):
        """Pool balls of points, truth and unit noise."""
        parts, count, of_tail = [], 0, 0.0
        for points, clean, noise in balls:
            exponents = tail_exponents(points.shape[1], degree)
            found, both = spectra(points.T.copy(), np.array([clean, noise]), np.ones(len(points)), exponents, power)
            parts.append([found / len(points), *both])
            count, of_tail = count + len(points), of_tail + noise @ noise - both[1] @ both[1]
        return cls(*np.concatenate(parts, axis=1), count, of_tail)

    def data(self, sigma):
        return self.clean + sigma * self.unit

    def kept(self, amounts):
        """Return the share of each coefficient that is kept, a row for each amount (of smoothing on N points, s/N)."""
        return self.eigenvalues / (self.eigenvalues + amounts[:, np.newaxis])

    def errors(self, amounts, sigma):
        """Return the root of the sum of squared errors at the points, for each amount."""
        lost = np.sum((self.kept(amounts) * self.data(sigma) - self.clean) ** 2, axis=1)
        return np.sqrt(lost + sigma**2 * self.of_tail)


def efficiencies(case, sigma):
    """Return, for each rule, the error of the amount that it takes over that of the best."""
    positive = case.eigenvalues[case.eigenvalues > 0]
    amounts = np.geomspace(positive.min() / 10, positive.max() * 100, AMOUNTS)
    kept, count = case.kept(amounts), case.count
    residual, free = np.sum(((1 - kept) * case.data(sigma)) ** 2, axis=1), np.sum(1 - kept, axis=1)
    score = count * residual / free**2
    squares = (count - len(case.eigenvalues) + np.sum(kept**2, axis=1)) / count
    inflated = count - 1.2 * (count - free)
    places = {
        "min V": np.argmin(score),
        "V_min (1 + 1/N)": np.flatnonzero(score <= score.min() * (1 + 1 / count))[-1],
        "robust GCV, γ = 0.8": np.argmin(score * (0.8 + 0.2 * squares)),
        "robust GCV, γ = 0.3": np.argmin(score * (0.3 + 0.7 * squares)),
        "traces times 1.2": np.argmin(np.where(inflated > 0.02 * count, residual / inflated**2, np.inf)),
    }
    taken = {rule: amounts[at] for rule, at in places.items()}
    taken["this rule"] = choose_by_gcv(Spectrum(case.eigenvalues, case.data(sigma), count))
    best = case.errors(amounts, sigma).min()
    return dict(zip(taken, case.errors(np.array(list(taken.values())), sigma) / best, strict=True))


def simulate(name, balls, sizes, repeats):
    """Print the rules' table for cases of so many balls of so many points."""
    rng = np.random.default_rng(0)
    found = []
    for (dimension, power, degree), truth, _ in product(KERNELS, TRUTHS, range(repeats)):
        points = [ball_points(rng.integers(*sizes), dimension, rng) for _ in range(balls)]
        clean = [truth(each, rng) for each in points]
        noise = [rng.standard_normal(len(each)) for each in points]
        case = Case.of(zip(points, clean, noise, strict=True), power, degree)
        spread = np.std(np.concatenate(clean)) or 1.0
        found += [efficiencies(case, share * spread) for share in NOISE]
    print(f"{name}, {len(found)} cases{'mean':>12}{'99 %':>8}{'above 1.1':>12}")
    for rule in found[0]:
        values = np.array([each[rule] for each in found])
        share = f"{100 * np.mean(values > 1.1):.1f} %"
        print(f"{rule:>30}{values.mean():>9.3f}{np.quantile(values, 0.99):>8.3g}{share:>12}")


def volume_table(noise, **options):
    """Print the rms errors on the synthetic volume."""
    volume, truth = o3l.samples.wheat_ct(noise=noise, drift=0.0, **options)
    level = volume.threshold()
    points, values = volume.to_samples(level)
    between = np.random.default_rng(0).uniform(points.min(axis=0), points.max(axis=0), (20_000, 3))

    def errors(rho):
        field = o3l.PUInterpolant.fit(points, values, rho=rho)
        return [float(np.sqrt(np.mean((field(at) - truth(at) + level) ** 2))) for at in (points, between)]

    grid = np.array([errors(rho) for rho in np.geomspace(1e-3, 1, 13)]).min(axis=0)
    rows = np.array([errors(0.0), errors("gcv"), errors("gcv-per-ball"), grid]).T
    print(f"{len(points):,} voxels{'interpolated':>22}{'gcv':>10}{'gcv-per-ball':>15}{'best of a grid':>17}")
    for where, row in zip(("voxels", "between voxels"), rows, strict=True):
        print(f"noise {noise}, {where:<15}{row[0]:>9.5f}{row[1]:>10.5f}{row[2]:>15.5f}{row[3]:>17.5f}")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few cases, to see that it runs")
    quick = parser.parse_args(arguments).quick
    simulate("one ball of 150 to 400", 1, (150, 400), 1 if quick else 40)
    simulate("one ball of 15 to 40", 1, (15, 40), 1 if quick else 60)
    if not quick:
        simulate("eight balls of 150 to 300", 8, (150, 300), 12)
    for noise in (0.003, 0.010):
        volume_table(noise, **({"size": (600.0, 600.0, 480.0)} if quick else {}))


if __name__ == "__main__":
    main()
