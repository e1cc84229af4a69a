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


def anywhere(places):
    return np.ones(len(places), dtype=bool)


def nowhere(places):
    return np.zeros(len(places), dtype=bool)


def test_a_surface_is_that_of_the_field_and_its_gradient_asked_once():
    plain, counted = followed(Counted(), features=True), Counted()
    memory = RememberedField(counted)
    for array, expected in zip(followed(memory, features=True), plain, strict=True):
        assert np.array_equal(array, expected)
    once = counted.asked
    gradients = memory.gradient(plain[0])
    assert counted.asked == once
    assert np.array_equal(gradients, Counted().gradient(plain[0]))


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1), slice(None, None, 3)])
def test_places_are_known_in_any_order(order):
    places, counted = np.random.default_rng(0).normal(size=(5_000, 3)), Counted()
    memory = RememberedField(counted)
    values, gradients = memory(places), memory.gradient(places)
    memory = memory.changed(counted, nowhere)
    once = counted.asked
    found = values_and_gradients(memory, places[order])
    assert np.array_equal(found[0], values[order])
    assert np.array_equal(found[1], gradients[order])
    assert counted.asked == once


def test_what_has_changed_is_asked_again_and_no_more():
    places = np.random.default_rng(0).uniform(-1, 1, (5_000, 3))
    memory, dented = RememberedField(Counted()), Counted(dent=0.6)
    memory.gradient(places)
    memory = memory.changed(dented, lambda places: places[:, 0] > dented.dent)
    assert np.array_equal(memory.gradient(places), Counted(dent=0.6).gradient(places))
    assert 0 < dented.asked < len(places)


def test_second_derivatives_are_not_kept():
    with pytest.raises(InputError, match="level: is 2"):
        RememberedField(Sphere()).jets(np.zeros((1, 3)), 2)


def test_a_full_memory_asks_for_the_rest_again(monkeypatch):
    monkeypatch.setattr(remembered, "MAX_PLACES", 1000)
    places, counted = np.random.default_rng(0).normal(size=(1500, 3)), Counted()
    memory = RememberedField(counted)
    gradients = memory.gradient(places)
    once = counted.asked
    assert np.array_equal(memory.gradient(places), gradients)
    assert 3 * counted.asked == 4 * once
