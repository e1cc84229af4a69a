"""Collapse, swap, split: half-edges stay sound, the surface stays a manifold of its kind; brute force agrees."""

import numpy as np
import pytest

import reference
from o3dleaf.core.errors import InputError
from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.halfedge_loops import (
    CREASE,
    LOCKED,
    MAX_VALENCE,
    SMOOTH,
    after,
    before,
    can_collapse,
    can_flip,
    collapse,
    fan,
    flip,
    split,
)
from o3dleaf.surface.remeshing.submesh import Submesh
from remesh_fields import NAMES, charted


def submesh_of(name, size, locked=0.0, seed=0):
    mesh = charted(name, size)
    chosen = np.random.default_rng(seed).random(len(mesh.places)) < locked
    return Submesh(mesh, chosen), chosen


def triangles_of(mesh):
    corners = mesh.origin.reshape(-1, 3)
    return corners[corners[:, 0] >= 0]


def check_soundness(mesh, labels):
    """Raise where the arrays contradict one another."""
    origin, twin, crease, outgoing, kind = mesh
    there = np.flatnonzero(origin >= 0)
    ends = origin[there - there % 3 + (there + 1) % 3]
    inner = twin[there] >= 0
    h, g = there[inner], twin[there[inner]]
    assert np.array_equal(twin[g], h)
    assert np.all(h // 3 != g // 3)
    assert np.array_equal(origin[g], ends[inner])
    assert np.array_equal(crease[h], labels[h // 3] != labels[g // 3])
    assert not crease[there[~inner]].any()
    used = np.unique(origin[there])
    assert np.array_equal(np.flatnonzero(outgoing >= 0), used)
    assert np.array_equal(origin[outgoing[used]], used)
    sharp = np.bincount(origin[there][crease[there]], minlength=len(kind))
    assert np.all(sharp[used][kind[used] == SMOOTH] == 0)
    assert np.all(sharp[used][kind[used] == CREASE] == 2)
    assert np.all(kind[np.concatenate([origin[there[~inner]], ends[~inner]])] == LOCKED)
    count, halves = np.bincount(origin[there], minlength=len(kind)), np.empty(MAX_VALENCE, dtype=np.int64)
    for v in used[kind[used] != LOCKED]:
        around = halves[: fan(mesh, v, halves)]
        assert len(around) == (count[v] if count[v] <= MAX_VALENCE else 0)
        assert np.all(origin[around] == v)
        assert np.array_equal(origin[before(around[0])], origin[after(around[1])])


@pytest.mark.few(name=1)
@pytest.mark.parametrize("name", NAMES)
def test_thousands_of_edits_leave_a_sound_manifold_of_the_same_kind(name):
    """Locked vertices and the border keep their names, creases go on between the labels."""
    submesh, locked = submesh_of(name, 2, 0.05)
    rng, mesh, vertices, triangles = np.random.default_rng(1), submesh.mesh, submesh.vertices, submesh.triangles
    first = triangles_of(mesh)
    kind_of = mesh_report((submesh.places, first))
    around, halves, done = *(np.empty(MAX_VALENCE, dtype=np.int64) for _ in range(2)), np.zeros(3, dtype=int)
    for n in range(6000):
        h = rng.choice(np.flatnonzero(mesh.origin >= 0))
        # Dense at first, then as sparse as can be, then dense again.
        edit = rng.choice(3, p=[0.2, 0.4, 0.4] if n % 3000 < 1500 else [0.6, 0.4, 0.0])
        if edit == 0 and (count := can_collapse(mesh, h, around, halves)):
            collapse(mesh, h, around, count)
        elif edit == 1 and can_flip(mesh, h, halves):
            flip(mesh, h)
        elif edit == 2 and mesh.twin[h] >= 0 and triangles + 2 < len(submesh.labels) and vertices < len(submesh.places):
            mesh.kind[vertices] = CREASE if mesh.crease[h] else SMOOTH
            submesh.labels[triangles : triangles + 2] = submesh.labels[h // 3], submesh.labels[mesh.twin[h] // 3]
            split(mesh, h, vertices, triangles)
            vertices, triangles = vertices + 1, triangles + 2
        else:
            continue
        done[edit] += 1
        if done.sum() % 300 == 0:
            check_soundness(mesh, submesh.labels)
    assert done.min() > 100
    assert done.sum() > 1000
    check_soundness(mesh, submesh.labels)
    last = triangles_of(mesh)
    report = mesh_report((rng.random((vertices, 3)), last))
    for figure in ("components", "boundary_edges", "boundary_loops", "genus", "manifold", "oriented"):
        assert getattr(report, figure) == getattr(kind_of, figure), figure
    assert report.manifold
    assert report.duplicate_triangles == 0
    assert reference.border(last) == reference.border(first)
    assert set(np.flatnonzero(locked)) <= set(last.ravel())


@pytest.mark.few(name=3)
@pytest.mark.parametrize("locked", [0.0, 0.2])
@pytest.mark.parametrize("name", [*NAMES, "tetrahedron"])
def test_an_edit_is_refused_where_brute_force_says_that_the_surface_would_not_be_of_its_kind(name, locked):
    """Beyond that, where what is locked, on a crease or unknown forbids it."""
    answers = {True: 0, False: 0}
    for seed in range(3):
        submesh, _ = submesh_of(name, int("four" in name), locked, seed)
        rng, mesh = np.random.default_rng(seed), submesh.mesh
        around, halves = (np.empty(MAX_VALENCE, dtype=np.int64) for _ in range(2))
        for _ in range(25):
            origin, twin, crease, _, kind = mesh
            now = triangles_of(mesh)
            beside = {v: set(now[(now == v).any(axis=1)].ravel()) for v in np.unique(now)}
            names, allowed = len(beside), []
            for h in rng.choice(np.flatnonzero(origin >= 0), min(6, 3 * len(now)), replace=False):
                g, v, w = twin[h], origin[h], origin[after(h)]
                fate = kind[v] == SMOOTH or (kind[v] == CREASE and crease[h])
                if fate:
                    c, d = origin[before(h)], origin[before(g)]
                    others = beside[v] - {v, w, c, d}
                    two = (crease[before(h)] and crease[after(h)]) or (crease[after(g)] and crease[before(g)])
                    unknown = kind[w] == LOCKED and LOCKED in kind[[*others]]
                    fate = not (two or unknown)
                    fate = fate and reference.is_same_kind(now, reference.collapsed(now, v, w), names - 1)
                assert (can_collapse(mesh, h, around, halves) > 0) == fate
                flips = g >= 0 and not crease[h]
                if flips:
                    c, d = origin[before(h)], origin[before(g)]
                    flips = c != d and not (kind[c] == kind[d] == LOCKED)
                    flips = flips and reference.is_same_kind(now, reference.flipped(now, v, w, c, d), names)
                assert can_flip(mesh, h, halves) == flips
                allowed += [(h, 0)] * int(fate) + [(h, 1)] * int(flips)
                answers[bool(fate)] += 1
            if allowed:
                h, edit = allowed[rng.integers(len(allowed))]
                v, w = origin[h], origin[after(h)]
                if edit == 0:
                    expected = reference.collapsed(now, v, w)
                    collapse(mesh, h, around, can_collapse(mesh, h, around, halves))
                else:
                    expected = reference.flipped(now, v, w, origin[before(h)], origin[before(twin[h])])
                    flip(mesh, h)
                assert turned(triangles_of(mesh)) == turned(expected)
    assert answers[False] > 20
    assert (answers[True] > 20) is (name != "tetrahedron")


def turned(triangles):
    """Each triangle begun at its smallest corner, in a set."""
    return {tuple(np.roll(corners, -int(np.argmin(corners)))) for corners in triangles}


@pytest.mark.parametrize("name", NAMES)
def test_a_split_puts_a_vertex_on_the_edge(name):
    submesh, _ = submesh_of(name, 0)
    mesh = submesh.mesh
    for step in range(20):
        now = triangles_of(mesh)
        h = np.flatnonzero(mesh.twin >= 0)[7 * step % len(now)]
        vertex, triangle = submesh.vertices + step, submesh.triangles + 2 * step
        expected = reference.halved(now, mesh.origin[h], mesh.origin[after(h)], vertex)
        mesh.kind[vertex] = CREASE if mesh.crease[h] else SMOOTH
        submesh.labels[triangle : triangle + 2] = submesh.labels[h // 3], submesh.labels[mesh.twin[h] // 3]
        split(mesh, h, vertex, triangle)
        assert turned(triangles_of(mesh)) == turned(expected)
        check_soundness(mesh, submesh.labels)


def wheel(spokes):
    """A cone over a ring: its tip has that many triangles, and one vertex beside it is not locked either."""
    angle = 2 * np.pi * np.arange(spokes) / spokes
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    n, k = np.arange(spokes), spokes
    inner = np.column_stack([n, (n + 1) % k, np.full(k, k)])
    below = np.column_stack([(n + 1) % k, n, np.full(k, k + 1)])
    return np.vstack([ring, [[0, 0, 1], [0, 0, -1]]]), np.vstack([inner, below])


@pytest.mark.parametrize("spokes", [MAX_VALENCE, MAX_VALENCE + 1])
def test_around_a_vertex_with_too_many_triangles_nothing_is_done(spokes):
    vertices, triangles = wheel(spokes)
    labels = np.zeros(len(triangles), dtype=np.uint8)
    mesh = Submesh(Charted.of(vertices, vertices, triangles, labels), np.zeros(len(vertices), dtype=bool)).mesh
    around, halves = (np.empty(MAX_VALENCE, dtype=np.int64) for _ in range(2))
    tip = mesh.outgoing[spokes]
    assert fan(mesh, spokes, halves) == (spokes if spokes <= MAX_VALENCE else 0)
    assert can_collapse(mesh, tip, around, halves) == (spokes if spokes <= MAX_VALENCE else 0)
    # An edge of the ring: swapped it would join the tips.
    assert can_flip(mesh, after(tip), halves) is (spokes <= MAX_VALENCE)


def test_triangles_that_no_surface_has_are_refused():
    mesh = charted("sphere", 0)
    vertices, triangles = mesh.places, mesh.triangles
    count = len(vertices)
    fin = np.append(triangles, [[*triangles[0, :2], count]], axis=0)
    turned_one = np.concatenate([triangles[:1, ::-1], triangles[1:]])
    twice = np.concatenate([triangles, triangles[:1]])
    more = np.vstack([vertices, [[9.0, 9, 9]]])
    for bad in (fin, turned_one, twice):
        with pytest.raises(InputError, match="clean it first") as caught:
            Submesh(Charted.of(more, more, bad, np.zeros(len(bad), np.uint8)), np.zeros(count + 1, bool))
        assert "\n" not in str(caught.value)
