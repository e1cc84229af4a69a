"""The memory of a field: its answers to the last bit, asked once at each place, and again where it has changed."""

import numpy as np
import pytest

from o3dleaf import extract_isosurface
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import values_and_gradients
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.samples import Sphere
from o3dleaf.surface.isosurface import remembered
from o3dleaf.surface.isosurface.remembered import RememberedField


class Counted:
    """A ball's field with a dent beyond x = `dent`; counts the places that it is asked at."""

    def __init__(self, dent=np.inf):
        self.sphere, self.dent, self.asked = Sphere(), dent, 0

    @property
    def bounds(self):
        return self.sphere.bounds

    @property
    def unit(self):
        return self.sphere.unit

    def __call__(self, points):
        self.asked += len(points)
        return self.sphere(points) - 0.1 * np.maximum(points[:, 0] - self.dent, 0) ** 2

    def gradient(self, points):
        self.asked += len(points)
        beyond = 0.2 * np.maximum(points[:, 0] - self.dent, 0)
        return self.sphere.gradient(points) - beyond[:, np.newaxis] * np.eye(3)[0]


def followed(field, **options):
    points, _ = Sphere().sample(50)
    return mesh_arrays(extract_isosurface(field, 0.1, seeds=points, **options))


def test_a_surface_that_is_followed_again_asks_nothing_and_is_the_same():
    plain, counted = followed(Counted(), features=True), Counted()
    remembered = RememberedField(counted)
    first = followed(remembered, features=True)
    once = counted.asked
    again = followed(remembered.changed(counted, lambda places: np.ones(len(places), dtype=bool)), features=True)
    assert counted.asked == once > 0
    for mesh in (first, again):
        for array, expected in zip(mesh, plain, strict=True):
            assert np.array_equal(array, expected)


def test_what_has_changed_is_asked_again_and_no_more():
    remembered, dented = RememberedField(Counted()), Counted(dent=0.6)
    followed(remembered)
    found = followed(remembered.changed(dented, lambda places: places[:, 0] <= dented.dent))
    whole = Counted(dent=0.6)
    for array, expected in zip(found, followed(whole), strict=True):
        assert np.array_equal(array, expected)
    assert 0 < dented.asked < whole.asked / 2


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1), slice(None, None, 3)])
def test_places_are_known_in_any_order(order):
    places, counted = np.random.default_rng(0).normal(size=(5_000, 3)), Counted()
    remembered = RememberedField(counted)
    values, gradients = remembered(places), remembered.gradient(places)
    remembered = remembered.changed(counted, lambda places: np.ones(len(places), dtype=bool))
    once = counted.asked
    assert np.array_equal(remembered(places[order]), values[order])
    assert np.array_equal(values_and_gradients(remembered, places[order])[1], gradients[order])
    assert counted.asked == once


def test_second_derivatives_are_not_kept():
    with pytest.raises(InputError, match="level: is 2"):
        RememberedField(Sphere()).jets(np.zeros((1, 3)), 2)


def test_a_full_memory_asks_for_the_rest_again(monkeypatch):
    monkeypatch.setattr(remembered, "MAX_PLACES", 1000)
    places, counted = np.random.default_rng(0).normal(size=(1500, 3)), Counted()
    memory = RememberedField(counted)
    values = memory(places)
    assert np.array_equal(memory(places), values)
    assert counted.asked == 1500 + 500
