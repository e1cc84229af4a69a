"""Hairs that the top of a volume cuts are closed there, the same in every unit of length and of intensity."""

import numpy as np
import pytest

from o3dleaf import PUInterpolant, TiledField, mesh_report
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.leaf.meshing import extract_flat_tile
from tolerances import UNITS

UNITS_OF = [(1e-6, 1.0), (255.0, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (255.0, 1e-3)]


def texture(value=1.0, length=1.0, level=0.5):
    """A blade between two heights with one hair that leaves the patch through its top."""
    x, y, z = np.meshgrid(*[np.arange(count) + 0.5 for count in (14, 12, 16)], indexing="ij")
    blade = 3.0 - np.abs(z - 6.2 - 0.3 * np.sin(2 * np.pi * y / 12))
    hair = np.minimum(2.1 - np.hypot(x - 7.1, y - 5.8), z - 5.0)
    intensity = value / (1 + np.exp(-2 * np.maximum(blade, hair)))
    options = {"isovalue": value * level, "points_per_ball": (50, 100)}
    return TiledField(PUInterpolant.fit_lattice(intensity, spacing=length, **options))


@pytest.fixture(scope="module")
def plain():
    return extract_flat_tile(texture(), 1.0, 0.9)


def test_the_hair_ends_at_the_top_of_the_patch(plain):
    report = mesh_report(plain.mesh)
    assert (report.boundary_edges, report.components) == (0, 1)
    top = texture().cell[1, 2]
    assert top < plain.mesh.get_max_bound()[2] < top + 0.5


@pytest.mark.parametrize(("value", "length"), UNITS_OF)
def test_it_does_so_in_every_unit(plain, value, length):
    other = extract_flat_tile(texture(value, length), 1.0, 0.9 * length)
    (found, triangles), (expected, same) = mesh_arrays(other.mesh), mesh_arrays(plain.mesh)
    np.testing.assert_array_equal(triangles, same)
    np.testing.assert_allclose(found / length, expected, rtol=0, atol=UNITS)


@pytest.mark.parametrize(("value", "length"), UNITS_OF)
def test_a_blade_that_is_cut_itself_is_refused_in_every_unit(value, length):
    thick = texture(value, length, level=1e-3)
    with pytest.raises(ReconstructionError, match="no air above or below"):
        extract_flat_tile(thick, 1.0, 0.9 * length)
