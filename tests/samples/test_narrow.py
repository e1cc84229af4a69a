"""What is narrow is as narrow as was asked, and all of it is one closed piece without a handle."""

import numpy as np
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.core.lattice import Lattice
from o3dleaf.samples import bumps, fins, fold, gap
from o3dleaf.samples.meshed import level_mesh
from o3dleaf.samples.solids import CENTER, TURN
from o3dleaf.surface.isosurface.polygonize import polygonize
from o3dleaf.surface.mesh.topology import EdgeTable, label_triangles

WIDTH = 0.08
SAG = 0.02
"""Part of what is narrow: a mesh of six steps across it cuts its round ends by 1/8 (1/6)² / (1/2)."""


@pytest.mark.parametrize(
    ("kind", "size"), [(fins, WIDTH), (gap, WIDTH), (fold, WIDTH), pytest.param(bumps, 0.01, marks=pytest.mark.slow)]
)
def test_it_is_one_closed_piece_without_a_handle(kind, size):
    solid = kind(size)
    edges = EdgeTable.of(solid.triangles)
    assert (edges.count == 2).all()
    assert label_triangles(solid.triangles, edges).max() == 0
    assert len(solid.vertices) - len(edges.count) + len(solid.triangles) == 2


def across(solid, *places):
    return solid.signed_distance(np.array(places) @ TURN.T + CENTER)


def test_a_fin_is_as_thick_as_it_is_asked():
    assert np.abs(across(fins(WIDTH), [0.4, 0.0, 0.2]) + WIDTH / 2).max() < SAG * WIDTH


def test_a_gap_is_as_wide_as_it_is_asked_and_reaches_its_foot():
    found = across(gap(WIDTH), [0.0, 0.0, 0.1], [0.0, 0.0, -0.1])
    assert np.abs(found - WIDTH / 2).max() < SAG * WIDTH


def test_a_fold_lies_on_itself_at_the_distance_that_is_asked():
    between, within = across(fold(WIDTH), [0.0, 0.0, 0.0], [0.0, 0.1, WIDTH])
    assert abs(between - WIDTH / 2) < SAG * WIDTH
    assert abs(within + WIDTH / 2) < SAG * WIDTH


@pytest.mark.slow
def test_bumps_are_as_high_as_they_are_asked():
    solid = bumps(0.02, 0.15)
    height = np.linalg.norm(solid.vertices, axis=1) - 0.5
    assert abs(height.max() / 0.02 - 1) < 0.1
    assert abs(height.min() / -0.02 - 1) < 0.1


@pytest.mark.parametrize("kind", [fins, gap, fold, bumps])
def test_nothing_is_as_thick_as_zero(kind):
    with pytest.raises(InputError):
        kind(0.0)


def all_around(level, box, step):
    """Mesh a level set with a value at each point of its lattice."""
    lattice = Lattice.covering(box + step * np.array([[-1.0], [1.0]]), step)
    axes = (o + s * np.arange(n) for o, s, n in zip(lattice.origin, lattice.spacing, lattice.shape, strict=True))
    values = level(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    crossings, triangles = polygonize(values.reshape(lattice.shape), 0.0)
    return lattice.positions(crossings), triangles


@pytest.mark.few(kind=3)
@pytest.mark.parametrize(("kind", "size"), [(fins, 0.15), (gap, 0.15), (fold, 0.15), (bumps, 0.045)])
def test_values_far_from_the_surface_change_nothing(kind, size, monkeypatch):
    asked = []

    def both(level, box, step, steepness):
        few = level_mesh(lambda points: asked.append(len(points)) or level(points), box, step, steepness)
        whole = all_around(lambda points: asked.append(-len(points)) or level(points), box, step)
        assert np.array_equal(few[0], whole[0])
        assert np.array_equal(few[1], whole[1])
        return few

    monkeypatch.setattr("o3dleaf.samples.narrow.level_mesh", both)
    kind(size)
    assert sum(asked) < 0
