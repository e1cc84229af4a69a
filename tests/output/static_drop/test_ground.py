"""The surface under a drop: a series that is what its grid was, with integrals in Evolver's language."""

import math

import numpy as np
import pytest

from o3dleaf.output.static_drop.cap import cap_mesh, cap_radius
from o3dleaf.output.static_drop.datafile import StaticDrop
from o3dleaf.output.static_drop.ground import CosineSeries
from tolerances import DIFFERENCES, SERIES, START_VOLUME

SIZE = np.array([2.0, 3.0])


@pytest.fixture(scope="module")
def series():
    weights = np.random.default_rng(3).normal(size=(4, 6))
    return CosineSeries(weights, SIZE)


@pytest.fixture(scope="module")
def places():
    return np.random.default_rng(4).uniform(-1, 1, (2, 40)) * SIZE[:, np.newaxis] / 2


def evaluated(text, x, y):
    """What Surface Evolver would make of an expression."""
    code = text.replace("\\\n", "").replace("^", "**")
    return eval(code, {"__builtins__": {}}, {"sin": np.sin, "cos": np.cos, "x": x, "y": y})


def test_a_grid_and_scattered_points_give_the_series_back(series, places):
    middles = [((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip((7, 9), SIZE, strict=True)]
    x, y = (each.ravel() for each in np.meshgrid(*middles, indexing="ij"))
    again = CosineSeries.of_grid(series(x, y).reshape(7, 9), SIZE)
    assert np.abs(again.coefficients[:4, :6] - series.coefficients).max() < SERIES
    assert np.abs(again.coefficients[4:]).max() < SERIES
    points = np.column_stack([*places, series(*places)])
    assert np.abs(CosineSeries.fit(points, SIZE, (4, 6)).coefficients - series.coefficients).max() < SERIES


def test_the_gradient_is_the_limit_of_differences(series, places):
    h = 1e-5
    for axis in range(2):
        shift = h * np.eye(2)[axis][:, np.newaxis]
        slope = (series(*(places + shift)) - series(*(places - shift))) / (2 * h)
        assert np.abs(series.gradient(*places)[:, axis] - slope).max() < DIFFERENCES


def test_evolver_reads_the_same_function_and_its_integrals(series, places):
    x, y = places
    values, h = series(x, y), 1e-5
    assert np.abs(evaluated(series.expression(), x, y) - values).max() < SERIES
    for text, density in ((series.integral(), values), (series.moment(), x * values)):
        slope = (evaluated(text, x + h, y) - evaluated(text, x - h, y)) / (2 * h)
        assert np.abs(slope - density).max() < DIFFERENCES
    assert evaluated(CosineSeries(np.zeros((1, 1)), SIZE).integral(), x, y) == 0


def test_functions_of_heights_and_slopes_are_series_too(series, places):
    square = series.derived(lambda heights, _: heights**2)
    assert np.abs(square(*places) - series(*places) ** 2).max() < SERIES
    steep = series.derived(lambda _, slopes: np.einsum("ni,ni->n", slopes, slopes))
    assert np.abs(steep(*places) - (series.gradient(*places) ** 2).sum(axis=1)).max() < 1e3 * SERIES
    half = series.scaled(0.5)
    assert np.abs(half(*(0.5 * places)) - 0.5 * series(*places)).max() < SERIES
    assert np.abs(half.gradient(*(0.5 * places)) - series.gradient(*places)).max() < SERIES


def test_the_shortest_wave_is_that_of_the_ridges():
    weights = np.zeros((3, 9))
    weights[0, 6], weights[2, 8] = 0.1, 0.0009
    assert CosineSeries(weights, SIZE).shortest_wave == pytest.approx(2 * SIZE[1] / 6)
    assert CosineSeries(np.ones((1, 1)), SIZE).shortest_wave == math.inf


@pytest.mark.parametrize("angle", [20, 90, 150, 170])
def test_a_drop_starts_as_a_cap_of_its_volume(angle):
    """Its line runs once around, counter-clockwise; all other edges have two triangles, one each way."""
    vertices, triangles, on_line = cap_mesh(np.radians(angle), 40)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert np.linalg.norm(vertices + [0, 0, cap_radius(np.radians(angle)) * np.cos(np.radians(angle))], axis=1) == (
        pytest.approx(cap_radius(np.radians(angle)))
    )
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert abs(volume / (4 * np.pi / 3) - 1) < START_VOLUME
    edges = np.concatenate([triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    assert len(np.unique(edges, axis=0)) == len(edges)
    known = {tuple(edge) for edge in edges.tolist()}
    line = [edge for edge in known if edge[::-1] not in known]
    assert len(line) == on_line
    assert {end for edge in line for end in edge} == set(range(len(vertices) - on_line, len(vertices)))
    start, stop = vertices[np.array(line).T]
    assert (start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0]).min() > 0


def test_the_file_says_what_it_holds():
    ridges = np.zeros((1, 9))
    ridges[0, 0], ridges[0, 8] = 1e-3, 2e-5
    drop = StaticDrop(CosineSeries(ridges, np.array([1e-3, 1e-3])), 120.0, 6e-4, about="Of a test.")
    text = drop.text()
    assert text.startswith("// Of a test.\n")
    assert drop.bond_number == pytest.approx(998 * 9.81 * 9e-8 / 0.072)
    assert f"parameter bond_number = {drop.bond_number:.12g}" in text
    formula = next(line for line in text.splitlines() if line.startswith("formula: z = "))
    y = np.linspace(-1, 1, 11)
    heights = evaluated(formula.removeprefix("formula: z = "), 0 * y, y)
    # In radii, about their mean.
    assert np.abs(heights - 2e-5 / 3e-4 * np.cos(8 * np.pi * (y * 3e-4 / 1e-3 + 0.5))).max() < SERIES
