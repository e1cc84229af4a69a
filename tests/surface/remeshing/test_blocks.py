"""Blocks: a partition whose common vertices are locked; what is put together is what was taken apart."""

from dataclasses import replace

import numpy as np
import pytest

from o3dleaf.core import progress
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.surface.remeshing import blocks
from o3dleaf.surface.remeshing.blocks import Charted, edit_in_blocks, edit_part
from remesh_fields import charted

SHARES = [0.5, 0.38, 0.62]
every = pytest.mark.parametrize("share", SHARES)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(blocks, "MAX_TRIANGLES", 150)


@pytest.fixture
def mesh():
    """Charts and places that differ, vertices that no triangle names, some known to be on the surface."""
    torus = charted("torus, two labels", 10, 0.1)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(torus.places) + 5)
    triangles = order[torus.triangles]
    places = rng.normal(size=(len(order), 3))
    places[order[: len(torus.places)]] = torus.places
    return Charted(places, rng.normal(size=places.shape), triangles, torus.labels, rng.random(len(places)) < 0.5)


def rows(mesh):
    """Each triangle as what it is at its corners, with its label, sorted."""
    at = np.column_stack([mesh.places, mesh.charts, mesh.on_surface])[mesh.triangles].reshape(len(mesh.triangles), -1)
    at = np.column_stack([at, mesh.labels])
    return at[np.lexsort(at.T)]


def stay(own, _):
    return own


def refine(own, locked):
    """Move what may move, and put a vertex into each triangle but the first, which goes away with its corners."""
    count, (a, b, c) = len(own.places), own.triangles.T
    new = count + np.arange(len(own.triangles))
    free = ~locked[:, np.newaxis]
    middle = [part[own.triangles].mean(axis=1) for part in (own.places, own.charts)]
    triangles = np.concatenate([np.stack(t, axis=1) for t in ([a, b, new], [b, c, new], [c, a, new])])
    return Charted(
        np.concatenate([own.places + 0.01 * free, middle[0]]),
        np.concatenate([own.charts - 0.01 * free, middle[1]]),
        triangles,
        np.tile(own.labels, 3),
        np.concatenate([own.on_surface | ~locked, np.ones(len(new), dtype=bool)]),
    )


@every
def test_where_nothing_is_done_the_mesh_is_the_same_up_to_order(mesh, share):
    found = edit_in_blocks(mesh, stay, share)
    used = np.unique(mesh.triangles)
    assert np.array_equal(found.places, mesh.places[used])
    assert np.array_equal(found.charts, mesh.charts[used])
    assert np.array_equal(rows(found), rows(mesh))


@every
def test_blocks_are_a_partition_and_lock_exactly_what_they_share(mesh, share):
    seen = []

    def note(own, locked):
        seen.append((own, locked))
        return own

    edit_in_blocks(mesh, note, share)
    assert len(seen) > 10
    assert max(len(own.triangles) for own, _ in seen) <= blocks.MAX_TRIANGLES
    assert min(len(own.triangles) for own, _ in seen) > blocks.MAX_TRIANGLES * 0.3
    parts = np.concatenate([rows(own) for own, _ in seen])
    assert np.array_equal(parts[np.lexsort(parts.T)], rows(mesh))
    names = [{row.tobytes() for row in own.places} for own, _ in seen]
    for k, (own, locked) in enumerate(seen):
        others = set().union(*names[:k], *names[k + 1 :])
        assert np.array_equal(np.unique(own.triangles), np.arange(len(own.places)))
        assert locked.tolist() == [row.tobytes() in others for row in own.places]


def test_blocks_of_another_share_have_their_borders_elsewhere(mesh):
    """No vertex of the torus is locked in all of them but a few, so that sweeps reach everything."""

    def locked_in(share):
        found = []
        edit_in_blocks(mesh, lambda own, locked: found.append(own.places[locked]) or own, share)
        return {row.tobytes() for part in found for row in part}

    sets = [locked_in(share) for share in SHARES]
    assert min(len(part) for part in sets) > 100
    assert len(set.intersection(*sets)) < 0.5 * min(len(part) for part in sets)


@every
def test_what_the_work_adds_is_put_where_it_belongs(mesh, share):
    shared = []
    edit_in_blocks(mesh, lambda own, locked: shared.append(own.places[locked]) or own, share)
    kept = {row.tobytes() for part in shared for row in part}
    found = edit_in_blocks(mesh, refine, share)
    used = np.unique(mesh.triangles)
    free = np.array([row.tobytes() not in kept for row in mesh.places])
    moved = replace(
        mesh,
        places=mesh.places + 0.01 * free[:, np.newaxis],
        charts=mesh.charts - 0.01 * free[:, np.newaxis],
        on_surface=mesh.on_surface | free,
    )
    assert 100 < free[used].sum() < len(used) - 100
    assert np.array_equal(found.places[: len(used)], moved.places[used])
    assert np.array_equal(found.charts[: len(used)], moved.charts[used])
    assert np.array_equal(found.on_surface[: len(used)], moved.on_surface[used])
    whole = refine(mesh, ~free)
    assert len(found.places) == len(used) + len(mesh.triangles)
    assert np.array_equal(rows(found), rows(whole))


@every
def test_the_result_does_not_depend_on_threads(mesh, share):
    threads, found = get_num_threads(), []
    try:
        for count in (1, 2, 4):
            set_num_threads(count)
            found.append(edit_in_blocks(mesh, refine, share))
    finally:
        set_num_threads(threads)
    for other in found[1:]:
        for name in ("places", "charts", "triangles", "labels", "on_surface"):
            assert np.array_equal(getattr(found[0], name), getattr(other, name))


def test_work_on_some_triangles_leaves_all_else_bit_for_bit(mesh):
    chosen = mesh.places[mesh.triangles].mean(axis=1)[:, 0] > 0.3
    found = edit_part(mesh, chosen, refine)
    rest = replace(mesh, triangles=mesh.triangles[~chosen], labels=mesh.labels[~chosen])
    count = len(rest.triangles)
    # Vertices are renumbered, places stay.
    part = replace(found, triangles=found.triangles[:count], labels=found.labels[:count])
    for name in ("places", "charts", "on_surface"):
        assert np.array_equal(getattr(part, name)[part.triangles], getattr(rest, name)[rest.triangles])
    assert np.array_equal(part.labels, rest.labels)
    assert len(found.triangles) == count + 3 * chosen.sum()
    inner = np.setdiff1d(mesh.triangles[chosen], mesh.triangles[~chosen])
    assert len(inner) > 20
    assert {row.tobytes() for row in mesh.places[inner] + 0.01} <= {row.tobytes() for row in found.places}


def test_progress_counts_blocks(mesh):
    calls, count = [], []
    with progress.listening(lambda done, total: calls.append(done / total)):
        edit_in_blocks(mesh, lambda own, locked: count.append(own) or own, 0.5)
        assert calls == pytest.approx([(k + 1) / len(count) for k in range(len(count))], abs=1 / progress.WHOLE)
    assert len(count) > 10
