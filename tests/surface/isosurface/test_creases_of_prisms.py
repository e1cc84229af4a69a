"""Creases of turned prisms are edges of the mesh, rods have none: on leaves as wide as drawn steps, on a lattice."""

import numpy as np
import pytest

from mesh_fields import prism, rod
from o3dleaf import extract_isosurface, mesh_report
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.continuation import Continuation
from o3dleaf.surface.isosurface.octree.dual_surface import _find_crossing
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from tolerances import CREASES_MISSED, ON_BEND, ON_CREASE

SHAPES = 12
STEP = 0.2


def continued(kind, rng, field):
    """Return a surface followed on a lattice, or on leaves that are two to four times as wide on one side."""
    seeds = mesh_arrays(extract_isosurface(field, 0.08))[0]
    fine, ratio, way = rng.uniform(0.03, 0.05), rng.uniform(2, 4), rng.normal(size=3)
    if kind == "lattice":
        return Continuation.of(field, np.full(3, 1.5 * fine), seeds, 0.0, within=None, box=field.bounds)
    steps = np.where(seeds @ way > 0, fine, fine * ratio)
    return Continuation.on_octree(field, steps, seeds, 0.0, within=None, box=field.bounds)


@pytest.mark.parametrize("kind", ["octree", "lattice"])
def test_creases_lie_on_the_mesh_which_is_closed_and_crosses_itself_nowhere(kind):
    missed = []
    for seed in range(SHAPES):
        rng = np.random.default_rng(seed)
        field, edges = prism(rng)
        followed = continued(kind, rng, field)
        vertices, triangles = followed.draw(sharpen=True, features=True)
        report = mesh_report((vertices, triangles))
        assert report.watertight
        assert (report.genus, report.self_intersections) == (0, 0)
        places = np.concatenate([np.linspace(begin, end, 101) for begin, end in edges])
        off = distance_to_mesh(vertices, triangles, places) / followed.band.widths_at(places)
        missed.append(np.mean(off > ON_CREASE))
    assert np.mean(missed) < CREASES_MISSED[kind]


@pytest.mark.few
@pytest.mark.parametrize("cells", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("kind", ["octree", "lattice"])
def test_a_surface_that_bends_within_a_cell_without_a_crease_stays_round(kind, cells):
    """Of rods a few cells thick normals differ as they do across creases; tangent planes meet off them."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        field, side = rod(rng, cells * STEP), rng.normal(size=3)
        seeds = mesh_arrays(extract_isosurface(field, STEP / 4))[0]
        steps = np.where(seeds @ side > 0, STEP / 2, STEP)
        if kind == "lattice":
            followed = Continuation.of(field, np.full(3, STEP), seeds, 0.0, within=None, box=field.bounds)
        else:
            followed = Continuation.on_octree(field, steps, seeds, 0.0, within=None, box=field.bounds)
        vertices, _ = followed.draw(sharpen=True, features=True)
        assert np.abs(field(vertices)).max() < ON_BEND * STEP


def test_triangles_are_found_that_cross_others_far_away_along_the_mesh():
    """A moved vertex of one piece, and another piece that it goes through."""
    pieces = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.3, 0.2, -1], [0.2, 0.3, 1]], dtype=float)
    triangles = np.arange(6).reshape(2, 3)
    assert _find_crossing(pieces, triangles, np.array([0])).tolist() == [0, 1]
    pieces[3:, 0] += 2
    assert not len(_find_crossing(pieces, triangles, np.array([0])))
