"""An edit is done exactly where a literal reading of its rules says so, and no pass makes the worst triangle worse."""

import numpy as np
import pytest

import reference
from o3dleaf.surface.remeshing import edit_loops, move_loops
from o3dleaf.surface.remeshing.halfedge_loops import (
    CREASE,
    LOCKED,
    MAX_VALENCE,
    SMOOTH,
    after,
    before,
    can_collapse,
    can_flip,
)
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.shape_loops import square_to_segment, square_to_triangle
from o3dleaf.surface.remeshing.submesh import Submesh
from remesh_fields import NAMES, charted
from tolerances import SCORE

LIMITS = [
    Limits(shortest=0.2, longest=longest, deviation=deviation, quality=quality, min_cosine=least)
    for quality, least, deviation, longest in [
        (0.5, 0.6, 0.1, 9.0),
        (0.26, 0.2, 0.05, 0.8),
        (0.05, -0.2, 1.0, 9.0),
        (0.3, 0.95, 1.0, 9.0),
    ]
]
every = pytest.mark.parametrize("limits", LIMITS, ids=str)


def submeshes(size=1, noise=0.25):
    for seed, name in enumerate(NAMES):
        mesh = charted(name, size, noise, seed)
        yield Submesh(mesh, np.random.default_rng(seed).random(len(mesh.places)) < 0.05)


def room():
    return (np.empty(MAX_VALENCE, dtype=np.int64) for _ in range(2)), np.empty((2, MAX_VALENCE, 3))


def copied(mesh):
    return type(mesh)(*(part.copy() for part in mesh))


def triangles_of(mesh):
    corners = mesh.origin.reshape(-1, 3)
    return corners[corners[:, 0] >= 0]


def normal(corners):
    return np.cross(corners[1] - corners[0], corners[2] - corners[0])


def cosine(u, v):
    return u @ v / np.linalg.norm(u) / np.linalg.norm(v)


def score(triangles, rows, place):
    """Return the score of some rows of triangles among all of them."""
    beyond = {(corners[i], corners[i - 1]): t for t, corners in enumerate(triangles.tolist()) for i in range(3)}
    chosen = np.arange(len(triangles))[rows]
    pairs = [(t, beyond.get((c[i - 1], c[i]), -1)) for t in chosen for c in [triangles[t].tolist()] for i in range(3)]
    pairs = np.array([pair for pair in pairs if pair[1] >= 0], dtype=int).reshape(-1, 2)
    p, q, r = np.moveaxis(place[triangles], 1, 0)
    return reference.score(place[triangles[chosen]], np.cross(q - p, r - p)[pairs])


def better(after_it, before_it, fair):
    """Say whether a score is fair or better, and None if roundings decide."""
    if min(abs(after_it - fair), abs(after_it - before_it)) < SCORE:
        return None
    return after_it >= fair or after_it > before_it


def keep_facing(old, old_labels, new, new_labels, flat):
    """Say whether new normals, each with the old one it comes from, face as the sum of the old ones of their label."""
    for (normal_now, was), label in zip(new, new_labels, strict=True):
        total = sum(n for n, other in zip(old, old_labels, strict=True) if other == label)
        if cosine(normal_now, total) < min(flat, cosine(was, total)):
            return False
    return True


@pytest.mark.few(limits=2)
@every
def test_a_collapse_is_done_where_its_rules_allow_it(limits):
    fair, flat, deviation, longest = limits.quality, limits.min_cosine, limits.deviation, limits.longest
    answers = {True: 0, False: 0}
    for submesh in submeshes():
        mesh, place, label = submesh.mesh, submesh.places, submesh.labels
        (around, halves), normals = room()
        for h in np.random.default_rng(0).permutation(3 * submesh.triangles)[:60]:
            origin, crease, kind = mesh.origin, mesh.crease, mesh.kind
            if origin[h] < 0:
                continue
            count = can_collapse(mesh, h, around, halves)
            if not count:
                assert not edit_loops.try_collapse(mesh, label, place, h, limits, around, halves, normals)
                continue
            v, w, fan = origin[h], origin[after(h)], around[:count].copy()
            now = triangles_of(mesh)
            then = reference.collapsed(now, v, w)
            gone = [w in origin[t // 3 * 3 : t // 3 * 3 + 3] for t in fan]
            left = [t // 3 for t, is_gone in zip(fan, gone, strict=True) if not is_gone]
            corners = [np.where(origin[3 * t : 3 * t + 3] == v, w, origin[3 * t : 3 * t + 3]) for t in left]
            rows = [int(np.flatnonzero((then == c).all(axis=1))[0]) for c in corners]
            improved = better(score(then, rows, place), score(now, (now == v).any(axis=1), place), fair)
            old = {t // 3: normal(place[origin[t // 3 * 3 : t // 3 * 3 + 3]]) for t in fan}
            new = [(normal(place[c]), old[t]) for c, t in zip(corners, left, strict=True)]
            fate = keep_facing(old.values(), label[[*old]], new, label[left], flat)
            fate = fate and all(np.linalg.norm(place[x] - place[w]) <= longest for c in corners for x in c)
            fate = fate and min(square_to_triangle(place[v], *place[c]) for c in corners) <= deviation**2
            spike = crease[before(h)] or crease[after(mesh.twin[h])]
            if kind[v] == CREASE and not spike:
                other = next(origin[after(t)] for t in fan if crease[t] and origin[after(t)] != w)
                fate = fate and square_to_segment(place[v], place[w], place[other]) <= deviation**2
            if improved is None:
                continue
            fate = fate and improved
            assert edit_loops.try_collapse(mesh, label, place, h, limits, around, halves, normals) == fate
            answers[fate] += 1
    assert min(answers.values()) > 10


@pytest.mark.few(limits=2)
@every
def test_a_swap_is_done_where_its_rules_allow_it(limits):
    flat, deviation, longest = limits.min_cosine, limits.deviation, limits.longest
    answers = {True: 0, False: 0}
    for submesh in submeshes():
        mesh, place = submesh.mesh, submesh.places
        (_, halves), _ = room()
        for h in np.random.default_rng(0).permutation(3 * submesh.triangles)[:50]:
            origin, twin = mesh.origin, mesh.twin
            if not can_flip(mesh, h, halves):
                assert not edit_loops.try_flip(mesh, place, h, limits, halves)
                continue
            a, b, c, d = origin[h], origin[after(h)], origin[before(h)], origin[before(twin[h])]
            now = triangles_of(mesh)
            then = reference.flipped(now, a, b, c, d)
            pair = [row for row, x in enumerate(now.tolist()) if set(x) in ({a, b, c}, {a, b, d})]
            worst, least = score(now, pair, place), score(then, [-1, -2], place)
            old = [normal(place[now[row]]) for row in pair]
            new = [normal(place[row]) for row in then[-2:]]
            most = min(flat, *(cosine(n, old[0] + old[1]) for n in old))
            fate = least > 1.0001 * worst and min(cosine(n, old[0] + old[1]) for n in new) >= most
            fate = fate and np.linalg.norm(place[c] - place[d]) <= longest
            across = np.cross(place[b] - place[a], place[d] - place[c])
            fate = fate and abs(across @ (place[c] - place[a])) <= deviation * np.linalg.norm(across)
            assert edit_loops.try_flip(mesh, place, h, limits, halves) == fate
            answers[bool(fate)] += 1
    assert min(answers.values()) > 10


@pytest.mark.few(limits=2)
@every
def test_a_vertex_moves_where_its_rules_allow_it(limits):
    fair, flat, longest = limits.quality, limits.min_cosine, limits.longest
    answers = {True: 0, False: 0}
    for seed, submesh in enumerate(submeshes()):
        mesh, place, label = submesh.mesh, submesh.places, submesh.labels
        rng = np.random.default_rng(seed)
        now = triangles_of(mesh)
        for v in rng.permutation(np.flatnonzero(mesh.kind[: submesh.vertices] != LOCKED))[:40]:
            point = place[v] + rng.choice([0.03, 0.15]) * rng.normal(size=3)
            there = place.copy()
            there[v] = point
            fan = np.flatnonzero((now == v).any(axis=1))
            improved = better(score(now, fan, there), score(now, fan, place), fair)
            if improved is None:
                continue
            old = [normal(place[now[t]]) for t in fan]
            new = [(normal(there[now[t]]), n) for t, n in zip(fan, old, strict=True)]
            fate = improved and keep_facing(old, label[fan], new, label[fan], flat)
            fate = fate and max(np.linalg.norm(place[x] - point) for t in fan for x in now[t] if x != v) <= longest
            moved = np.ones(1, dtype=bool)
            move_loops.move_vertices(mesh, label, place, np.array([v]), point[np.newaxis], limits, moved)
            assert moved[0] == fate
            assert np.array_equal(place, there if fate else np.where(place == point, np.nan, place))
            answers[bool(fate)] += 1
    assert min(answers.values()) > 10


@pytest.mark.few(limits=2)
@every
def test_a_split_is_done_where_its_rules_allow_it(limits):
    fair, flat = limits.quality, limits.min_cosine
    answers = {True: 0, False: 0}
    for seed, submesh in enumerate(submeshes()):
        mesh, place, label = submesh.mesh, submesh.places, submesh.labels
        rng = np.random.default_rng(seed)
        vertex, triangle = submesh.vertices, submesh.triangles
        for h in rng.permutation(np.flatnonzero(mesh.twin >= 0))[:25]:
            a, b = mesh.origin[h], mesh.origin[after(h)]
            pair = [mesh.origin[t // 3 * 3 : t // 3 * 3 + 3] for t in (h, mesh.twin[h])]
            point = (place[a] + place[b]) / 2 + 0.12 * rng.normal(size=3)
            there = place.copy()
            there[vertex] = point
            parts = [[[vertex if x == e else x for x in c] for e in (a, b)] for c in pair]
            least = reference.score(there[np.concatenate(parts)], [])
            worst = reference.score(place[np.array(pair)], [])
            pairs = [(part, c) for two, c in zip(parts, pair, strict=True) for part in two]
            facing = min(cosine(normal(there[part]), normal(place[c])) for part, c in pairs)
            fate = facing >= flat and (least >= fair or least >= 0.5 * worst)
            sharp, labels = mesh.crease[h], [label[h // 3], label[mesh.twin[h] // 3]]
            expected = reference.halved(triangles_of(mesh), a, b, vertex) if fate else triangles_of(mesh)
            halves = np.array([h])
            done = edit_loops.split_edges(mesh, label, place, halves, point[np.newaxis], limits, vertex, triangle)
            assert done == fate
            assert turned(triangles_of(mesh)) == turned(expected)
            answers[bool(fate)] += 1
            if fate:
                assert np.array_equal(place, there)
                assert halves[0] == 0
                assert mesh.kind[vertex] == (CREASE if sharp else SMOOTH)
                assert label[triangle : triangle + 2].tolist() == labels
                vertex, triangle = vertex + 1, triangle + 2
    assert min(answers.values()) > 10


def turned(triangles):
    return {tuple(np.roll(corners, -int(np.argmin(corners)))) for corners in triangles}


def test_of_several_splits_those_that_are_done_come_first():
    """Rows of what was done, in their order; vertices and triangles are numbered without gaps."""
    mesh = charted("sphere", 1)
    submesh = Submesh(mesh, np.zeros(len(mesh.places), dtype=bool))
    halves = np.empty(3 * submesh.triangles, dtype=np.int64)
    halves = halves[: edit_loops.mark_long(submesh.mesh, submesh.places, 0.1, halves)][:4].copy()
    ends = submesh.mesh.origin[halves], submesh.mesh.origin[[after(h) for h in halves]]
    points = (submesh.places[ends[0]] + submesh.places[ends[1]]) / 2
    # Beyond the opposite corner: the triangles there would fold.
    points[1] += 3 * (submesh.places[submesh.mesh.origin[before(halves[1])]] - points[1])
    expected = points[[0, 2, 3]]
    n, m = submesh.vertices, submesh.triangles
    done = edit_loops.split_edges(submesh.mesh, submesh.labels, submesh.places, halves, points, LIMITS[2], n, m)
    assert done == 3
    assert halves[:3].tolist() == [0, 2, 3]
    assert np.array_equal(submesh.places[n : n + 3], expected)
    assert np.array_equal(np.unique(triangles_of(submesh.mesh)), np.arange(n + 3))
    assert len(triangles_of(submesh.mesh)) == m + 6


@pytest.mark.parametrize("name", NAMES)
@every
def test_no_pass_makes_the_worst_score_worse(name, limits):
    """Unless it stays fair; and where a pass has found nothing to do it finds nothing the next time."""
    mesh = charted(name, 2, 0.2)
    submesh = Submesh(mesh, np.zeros(len(mesh.places), dtype=bool))
    arrays = submesh.mesh
    rng = np.random.default_rng(0)

    def move():
        rows = np.flatnonzero((arrays.outgoing >= 0) & (arrays.kind != LOCKED))
        points = submesh.places[rows] + 0.05 * rng.normal(size=(len(rows), 3))
        moved = np.empty(len(rows), dtype=bool)
        move_loops.move_vertices(arrays, submesh.labels, submesh.places, rows, points, limits, moved)
        return moved.sum()

    def collapse():
        return edit_loops.collapse_short(arrays, submesh.labels, submesh.places, np.arange(len(arrays.origin)), limits)

    def flip():
        return edit_loops.flip_edges(arrays, submesh.places, limits, 40)

    def cure():
        return edit_loops.improve_slivers(arrays, submesh.labels[: submesh.triangles], submesh.places, limits, 40)

    def whole():
        now = triangles_of(arrays)
        return score(now, np.arange(len(now)), submesh.places)

    worst = whole()
    for work in (flip, cure, move, collapse, flip, cure):
        before_it, count = arrays.origin.copy(), len(triangles_of(arrays))
        done = work()
        assert work is move or (done > 0) == (not np.array_equal(arrays.origin, before_it))
        assert whole() >= min(limits.quality, worst) - SCORE
        if work is collapse:
            assert len(triangles_of(arrays)) == count - 2 * done
        if work in (flip, cure):
            assert work() == 0
        worst = whole()


def test_long_edges_are_marked_that_are_the_longest_of_both_triangles():
    for submesh in submeshes(2):
        mesh, place = submesh.mesh, submesh.places
        origin, twin = mesh.origin[: 3 * submesh.triangles], mesh.twin
        ends = origin, origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
        length = np.linalg.norm(place[ends[0]] - place[ends[1]], axis=1)
        limit = np.median(length)
        longest = length.reshape(-1, 3).max(axis=1)
        expected = [
            h
            for h in range(len(origin))
            if h < twin[h] and length[h] > limit and length[h] == longest[h // 3] == longest[twin[h] // 3]
        ]
        halves = np.empty(len(origin), dtype=np.int64)
        found = halves[: edit_loops.mark_long(mesh, place, limit, halves)]
        assert found.tolist() == expected
        assert len(found) > 5


def test_of_equal_edges_no_two_of_one_triangle_are_marked():
    for name in ("sheet", "tetrahedron"):
        mesh = charted(name, 1)
        places = np.round(mesh.places * [1, 1, 0 if name == "sheet" else 1], 9)
        submesh = Submesh(type(mesh).of(places, places, mesh.triangles, mesh.labels), np.zeros(len(places), dtype=bool))
        halves = np.empty(3 * submesh.triangles, dtype=np.int64)
        found = halves[: edit_loops.mark_long(submesh.mesh, submesh.places, 1e-3, halves)]
        both = np.concatenate([found // 3, submesh.mesh.twin[found] // 3])
        assert len(found) > 0
        assert len(np.unique(both)) == len(both)


@pytest.mark.parametrize("share", [1.0, 0.7])
def test_shifts_lead_to_the_middle_of_the_triangles_along_the_surface_and_along_creases(share):
    kinds = []
    for submesh in submeshes():
        mesh, place = submesh.mesh, submesh.places
        now, (origin, _, crease, _, kind) = triangles_of(mesh), mesh
        shifts = np.full((submesh.vertices, 3), np.nan)
        move_loops.fill_shifts(mesh, place, share, shifts)
        for v, shift in enumerate(shifts):
            expected = np.zeros(3)
            if kind[v] == CREASE:
                p, q = (place[origin[after(h)]] for h in range(len(origin)) if origin[h] == v and crease[h])
                along = (p - q) / np.linalg.norm(p - q)
                expected = ((p + q) / 2 - place[v]) @ along * along
            elif kind[v] == SMOOTH:
                corners = place[now[(now == v).any(axis=1)]]
                normals = np.array([normal(c) for c in corners])
                out = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
                middle = np.average(corners.mean(axis=1), axis=0, weights=np.linalg.norm(normals, axis=1)) - place[v]
                expected = middle - middle @ out * out
            assert shift == pytest.approx(share * expected, abs=SCORE)
            kinds.append(kind[v])
    assert min(np.bincount(kinds)) > 10


def test_tries_are_shares_of_the_edges_out_of_the_corners_of_triangles_that_are_not_fair():
    for submesh in submeshes():
        mesh, place = submesh.mesh, submesh.places
        now, (origin, _, crease, _, kind) = triangles_of(mesh), mesh
        bad = {v for t in range(len(now)) if score(now, [t], place) < 0.3 for v in now[t]}
        expected = [
            (v, origin[after(h)])
            for v in bad
            for h in np.flatnonzero(origin == v)
            if kind[v] == SMOOTH or (kind[v] == CREASE and crease[h])
        ]
        counted = move_loops.fill_tries(mesh, place, 0.3, 0.1, np.empty(0, dtype=np.int64), np.empty((0, 3)))
        assert counted == len(expected)
        rows, shifts = np.empty(counted, dtype=np.int64), np.empty((counted, 3))
        assert move_loops.fill_tries(mesh, place, 0.3, 0.1, rows, shifts) == counted
        wanted = np.array([np.append(v, 0.1 * (place[w] - place[v])) for v, w in expected])
        found = np.column_stack([rows, shifts])
        assert found[np.lexsort(found.T)] == pytest.approx(wanted[np.lexsort(wanted.T)], abs=SCORE)
