"""Thickness by a map: smooth, between the factors of its table, and that of the leaf itself."""

import numpy as np
import pytest

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf import MultiscaleLeaf, ParametricBlade, ThicknessMap
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.parametric.thickness import ThicknessProduct, as_factors
from tolerances import ANALYTIC_VS_DIFFERENCE, TWIN

BOUNDS = np.array([[0.0, -3.0], [20.0, 3.0]])
TABLE = np.random.default_rng(0).uniform(0.5, 1.5, (6, 4))


def places(count=300, slack=0.0):
    return np.random.default_rng(1).uniform(BOUNDS[0] - slack, BOUNDS[1] + slack, (count, 2))


@pytest.fixture(scope="module")
def thickness():
    return ThicknessMap(TABLE, BOUNDS)


def test_factors_lie_between_those_of_the_table_and_stay_as_they_are_beyond_it(thickness):
    inside, outside = thickness.values(places()), places(slack=5.0)
    assert TABLE.min() <= inside.min()
    assert inside.max() <= TABLE.max() == thickness.most
    assert np.array_equal(thickness.values(outside), thickness.values(np.clip(outside, *BOUNDS)))


def test_a_table_of_equal_factors_is_one_and_a_sloping_one_slopes():
    assert np.allclose(ThicknessMap(np.full((3, 2), 0.7), BOUNDS).jet(places()), [0.7, 0, 0], atol=TWIN)
    assert np.allclose(ThicknessMap([[0.7]], BOUNDS).jet(places()), [0.7, 0, 0], atol=TWIN)
    slope = ThicknessMap(np.linspace(0.5, 1.5, 11)[:, np.newaxis] * np.ones(5), BOUNDS)
    middle = places() * [0.7, 1] + [3.0, 0]
    assert np.allclose(slope.jet(middle)[:, 0], 0.5 + middle[:, 0] / 20, atol=TWIN)
    assert np.allclose(slope.jet(middle)[:, 1:], [0.05, 0], atol=TWIN)


@pytest.mark.parametrize("product", [False, True])
def test_slopes_are_those_of_the_factors(thickness, product):
    one = ThicknessProduct(thickness, ThicknessMap(TABLE.T, BOUNDS)) if product else thickness
    points, step = places() * 0.99, 1e-5
    jet = one.jet(points)
    assert np.allclose(jet[:, 0], one.values(points), atol=TWIN)
    for axis in range(2):
        aside = step * np.eye(2)[axis]
        slope = (one.values(points + aside) - one.values(points - aside)) / (2 * step)
        assert np.abs(slope - jet[:, 1 + axis]).max() < ANALYTIC_VS_DIFFERENCE


@pytest.fixture(scope="module")
def leaves():
    """A flat slab of half thickness 0.2, plain, and as thick as a map has it."""
    plain = leaf_of(texture(lambda x, y, z: 0.2 - np.abs(z) + 0 * x, per_ball=80), bend=15.0)[0]
    blade = plain.blade
    mapped = ParametricBlade(blade.surface, blade.outline, thickness=ThicknessMap(TABLE, blade.outline.bounds))
    return plain, MultiscaleLeaf(plain.texture, blade=mapped)


def test_a_leaf_is_as_thick_as_its_map_has_it(leaves):
    plain, mapped = leaves
    flat = np.column_stack([places() * 0.8 + [2.0, 0], np.random.default_rng(2).uniform(-0.4, 0.4, 300)])
    factor = mapped.blade.thickness.values(flat[:, :2])
    thick = flat * np.column_stack([np.ones((300, 2)), factor])
    world = mapped.blade.lift(flat)
    assert np.allclose(world, plain.blade.lift(thick), atol=TWIN)
    assert np.allclose(mapped.blade.flatten(world), flat, atol=1e-6)
    assert np.allclose(mapped(world), plain(plain.blade.lift(flat)), atol=1e-6)


def test_the_gradient_of_a_mapped_leaf_is_that_of_its_field(leaves):
    mapped, step = leaves[1], 1e-5
    world = mapped.blade.lift(np.column_stack([places(60) * 0.8 + [2.0, 0], np.full(60, 0.11)]))
    gradients = mapped.gradient(world)
    for axis in range(3):
        aside = step * np.eye(3)[axis]
        slope = (mapped(world + aside) - mapped(world - aside)) / (2 * step)
        assert np.abs(slope - gradients[:, axis]).max() < 1e-4 * np.abs(gradients).max()


def test_distances_to_a_thick_leaf_have_the_right_sign(leaves):
    plain = leaves[0]
    thick = ParametricBlade(plain.blade.surface, plain.blade.outline, thickness=ThicknessMap([[3.0]], BOUNDS))
    leaf = MultiscaleLeaf(plain.texture, blade=thick)
    world = thick.lift(np.column_stack([places(40) * 0.5 + [5.0, 0], np.zeros(40)]))
    assert np.allclose(leaf.signed_distance(world), -0.6, atol=0.02)
    assert leaf.thickness == pytest.approx(3 * plain.thickness)


def test_a_mapped_solid_is_closed_and_saved_with_its_map(leaves, tmp_path):
    mapped = leaves[1]
    mesh = mapped.extract_mesh(0.3, closed=True)
    assert o3l.mesh_report(mesh).watertight
    mapped.save(tmp_path / "leaf.o3l")
    again = o3l.load(tmp_path / "leaf.o3l")
    assert np.array_equal(again.blade.thickness.factors, TABLE)
    assert np.array_equal(np.asarray(again.extract_mesh(0.3, closed=True).vertices), np.asarray(mesh.vertices))


def test_a_table_is_read_from_a_file(tmp_path):
    (tmp_path / "map.csv").write_text("1, 0.5\n0.8,1.5\n\n2,1\n")
    assert as_factors(tmp_path / "map.csv", "thickness").tolist() == [[1, 0.5], [0.8, 1.5], [2, 1]]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("1,2\n3\n", "different lengths"),
        ("a,b\n", "no table of numbers"),
        ("\n\n", "or none"),
        ("1,nan\n", "numbers from nan"),
        ("1,0\n", "numbers from 0 to 1"),
    ],
)
def test_what_is_no_table_of_factors_is_refused(tmp_path, text, match):
    (tmp_path / "map.csv").write_text(text)
    with pytest.raises(InputError, match=match):
        as_factors(tmp_path / "map.csv", "thickness")
    with pytest.raises(InputError, match="thickness"):
        o3l.create_blade(np.zeros((3, 3)), options=o3l.BladeOptions(thickness=[[0.0]]))
    with pytest.raises(InputError, match="frame 'surface'"):
        o3l.create_blade(np.zeros((3, 3)), options=o3l.BladeOptions(frame="paper", thickness=[[1.0, 1.0]]))
