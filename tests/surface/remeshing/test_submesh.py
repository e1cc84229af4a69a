"""Projections that a submesh accepts: none that is far away, none that did not reach the surface."""

import numpy as np
import pytest

from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.remeshing.halfedge_loops import CREASE, LOCKED
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.submesh import Submesh
from remesh_fields import NAMES, charted

LIMITS = Limits(0.1, 0.4, 0.05)


class Sphere:
    """The unit sphere, but for `wrong` points, every third: those are sent far away, or do not get there."""

    def __init__(self, wrong=None):
        self.wrong, self.asked = wrong, 0

    def project(self, charts, shifts, masks, creased):
        assert masks.dtype == np.uint8
        assert masks.all()
        places = charts + shifts
        places /= np.linalg.norm(places, axis=1, keepdims=True)
        found = np.ones(len(places), dtype=bool)
        self.asked += len(places)
        if self.wrong == "far":
            places[::3] *= 10
        if self.wrong == "lost":
            places[::3], found[::3] = 0.98 * places[::3], False
        return places, places, found


@pytest.mark.parametrize("wrong", [None, "far", "lost"])
@pytest.mark.parametrize("work", ["smooth", "improve"])
def test_vertices_stay_where_the_projection_fails(work, wrong):
    mesh = charted("sphere", 3)
    submesh, target = Submesh(mesh, np.zeros(len(mesh.places), dtype=bool)), Sphere(wrong)
    getattr(submesh, work)(target, LIMITS, 2)
    found = submesh.result()
    assert target.asked > 1000
    assert np.linalg.norm(found.places, axis=1) == pytest.approx(1, abs=1e-12)
    assert found.charts == pytest.approx(found.places, abs=1e-12)
    assert mesh_report((found.places, found.triangles)).watertight


@pytest.mark.parametrize("name", NAMES)
def test_masks_are_the_labels_around_a_vertex_and_kinds_follow_from_them(name):
    mesh = charted(name, 1)
    chosen = np.random.default_rng(0).random(len(mesh.places)) < 0.1
    submesh = Submesh(mesh, chosen)
    masks, kind = submesh._masks(), submesh.mesh.kind
    for v in range(len(mesh.places)):
        labels = mesh.labels[(mesh.triangles == v).any(axis=1)]
        assert masks[v] == sum(1 << label for label in set(labels.tolist()))
        if chosen[v]:
            assert kind[v] == LOCKED
        elif kind[v] == CREASE:
            assert len(set(labels.tolist())) == 2
