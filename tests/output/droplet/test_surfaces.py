"""The leaf around a landing place, its smooth twin, the leaf without hairs; and where droplets land."""

from dataclasses import dataclass

import numpy as np
import pytest

from leaf_fields import leaf_of, texture
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.output.droplet.frame import mean_height
from o3dleaf.output.droplet.landing import choose_places, face_heights
from o3dleaf.output.droplet.surfaces import VARIANTS, LandingWindow, grid_solid
from o3dleaf.output.export.consumers import enclosed_volume
from o3dleaf.surface.mesh.topology import EdgeTable
from tolerances import HAIR_LEFT, LEVEL_TWIN, ROUNDING, TWIN_HEIGHT

RIDGE, HAIR, WIDE = 0.02, 0.12, 0.04
"""Height of the ridges, of the hair and its width, in millimeters."""


@pytest.fixture(scope="module")
def leaf():
    """A bent strip with ridges along it, 0.2 thick."""
    return leaf_of(texture(ridged, half=0.2, tile=0.6, n=9), bend=15.0)[0]


def ridged(x, y, z):
    return (0.1 + RIDGE * np.cos(2 * np.pi * y / 0.6) - z) * (z + 0.1) + 0.0 * x


@dataclass(frozen=True)
class Hairy:
    """The same with one hair, as a function, on the blade of the leaf."""

    leaf: object
    foot: tuple[float, float] = (10.0, 0.3)

    def __getattr__(self, name):
        return getattr(object.__getattribute__(self, "leaf"), name)

    def values(self, flat):
        away = ((flat[:, :2] - self.foot) ** 2).sum(axis=1)
        top = 0.1 + RIDGE * np.cos(2 * np.pi * flat[:, 1] / 0.6) + HAIR * np.exp(-away / (2 * (WIDE / 2) ** 2))
        return top - flat[:, 2]


@pytest.fixture(scope="module")
def window(leaf):
    return LandingWindow(leaf, (10.0, 0.3), 1.2, 0.1)


@pytest.mark.parametrize("variant", VARIANTS)
def test_each_surface_is_a_closed_labelled_solid_around_the_origin(window, variant):
    surface = window.surface(variant)
    vertices, triangles = mesh_arrays(surface.mesh)
    edges = EdgeTable.of(triangles)
    assert (edges.count == 2).all()
    assert not edges.inconsistent.any()
    assert enclosed_volume(vertices, triangles) > 0
    assert sorted(set(surface.labels.tolist())) == [0, 1, 2]
    # The blade bends over 15: what is `size` wide on it is nearly so in the frame.
    assert np.allclose(np.ptp(vertices[:, :2], axis=0), 1.2, atol=0.02)


def test_leaf_and_twin_have_their_mean_height_at_zero(window):
    for variant, tolerance in (("leaf", ROUNDING), ("twin", TWIN_HEIGHT)):
        surface = window.surface(variant)
        vertices, triangles = mesh_arrays(surface.mesh)
        assert abs(mean_height(vertices, triangles[surface.labels == 0])) < tolerance


def test_the_twin_is_smooth_and_bent_as_the_blade(window):
    surface = window.surface("twin")
    vertices, triangles = mesh_arrays(surface.mesh)
    face = vertices[np.unique(triangles[surface.labels == 0])]
    # A piece of a cylinder of radius 15.1 or so about the axis across: z + x²/2r is one number.
    level = face[:, 2] + face[:, 0] ** 2 / (2 * 15.1)
    assert np.ptp(level) < LEVEL_TWIN


def test_a_hair_is_taken_off_and_ridges_stay(leaf):
    window = LandingWindow(Hairy(leaf), (10.0, 0.3), 1.2, 0.02)
    across = window.grid[1]
    ridges = 0.1 + RIDGE * np.cos(2 * np.pi * across / 0.6)
    plane = np.stack(np.meshgrid(*window.grid, [0.0], indexing="ij"), axis=-1)[:, :, 0]
    top = Hairy(leaf).values(plane.reshape(-1, 3)).reshape(plane.shape[:2])
    # The field is even in height, so that a straight line between two steps finds its zero.
    assert np.allclose(window.top_heights, top, atol=ROUNDING)
    assert top.max() > 0.1 - RIDGE + 0.9 * HAIR
    assert np.abs(window.bare_heights - ridges).max() < HAIR_LEFT * HAIR


def test_droplets_land_on_what_they_are_said_to(leaf):
    hairy = Hairy(leaf)
    found = choose_places(hairy, (10.0, 0.3), 24, seed=3, size=1.2, unit=1.0)
    assert [kind for kind, _ in found] == ["ridge", "furrow", "hair"] * 8
    for kind, (along, across) in found:
        phase = np.cos(2 * np.pi * across / 0.6)
        apart = np.hypot(along - 10.0, across - 0.3)
        assert (phase > 0.8, phase < -0.8, apart < WIDE)[("ridge", "furrow", "hair").index(kind)]
        assert (apart < 0.1) == (kind == "hair")
    assert found == choose_places(hairy, (10.0, 0.3), 24, seed=3, size=1.2, unit=1.0)
    assert found != choose_places(hairy, (10.0, 0.3), 24, seed=4, size=1.2, unit=1.0)


def test_a_leaf_without_hairs_has_none_to_land_on(leaf):
    window = LandingWindow(leaf, (10.0, 0.3), 0.6, 0.02)
    assert np.abs(face_heights(window)[1]).max() < HAIR_LEFT * HAIR
    with pytest.raises(InputError, match="no hair is left"):
        choose_places(leaf, (10.0, 0.3), 3, seed=0, size=1.2, unit=1.0)


def test_a_window_off_the_blade_is_refused(leaf):
    with pytest.raises(InputError, match="leaves the blade"):
        _ = LandingWindow(leaf, (10.0, 2.8), 1.2, 0.1).region


def test_a_solid_between_two_grids_holds_what_is_between():
    x, y = np.meshgrid(np.linspace(0, 2, 4), np.linspace(0, 3, 5), indexing="ij")
    vertices = np.concatenate([np.column_stack([x.ravel(), y.ravel(), np.full(20, z)]) for z in (0.5, 0.1)])
    triangles, labels = grid_solid(4, 5)
    assert np.isclose(enclosed_volume(vertices, triangles), 2 * 3 * 0.4, rtol=ROUNDING)
    areas = np.linalg.norm(np.cross(*np.diff(vertices[triangles], axis=1).transpose(1, 0, 2)), axis=1) / 2
    assert np.allclose(np.bincount(labels, areas), [6, 6, 10 * 0.4])
