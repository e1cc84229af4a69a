import numpy as np
import pytest

from o3dleaf.leaf.margin.gaps.joined_pieces import with_points_of
from o3dleaf.leaf.margin.gaps.sample_gaps import open_gaps
from o3dleaf.leaf.margin.sample_triangles import components_of, triangulate

MIDDLE, HALF = 12, 2.0
BOX = np.array([[MIDDLE - 1.5, 8.0], [MIDDLE + 1.5, 23.0]])


def slit_with(points_in_it, seed, box=BOX):
    """Return the triangles of a jittered lattice with a slit, those beside it, and those that lie in the slit."""
    rng = np.random.default_rng(seed)
    rows = np.stack(np.meshgrid(np.arange(24.0), np.arange(24.0)), axis=-1).reshape(-1, 2)
    rows += rng.uniform(-0.1, 0.1, rows.shape)
    rows = rows[(np.abs(rows[:, 0] - MIDDLE) > HALF) | (rows[:, 1] < 6)]
    inside = rng.uniform(*box, (points_in_it, 2))
    mesh = triangulate(np.concatenate([rows, inside]))
    banks = (mesh.triangles < len(rows)).all(axis=1)
    kept = banks & (mesh.reach < 1.9)
    return mesh, kept, ~kept


@pytest.mark.parametrize("count", [1, 5, 20])
def test_points_in_a_bay_are_joined_to_a_bank_and_what_was_open_stays_open(count):
    """Each takes one triangle, so that a disc stays one; of many some may have others all around them."""
    for seed in range(5):
        mesh, kept, bay = slit_with(count, seed)
        found = with_points_of(mesh, kept, bay)
        assert (found >= kept).all()
        assert np.array_equal(open_gaps(mesh, ~found), ~found)
        joined = len(np.unique(mesh.triangles[found])) - len(np.unique(mesh.triangles[kept]))
        assert np.count_nonzero(found) == np.count_nonzero(kept) + joined
        assert joined >= (count if count <= 5 else 0.8 * count)


def test_a_clump_in_a_bay_is_joined_to_one_bank():
    mesh, kept, bay = slit_with(6, 0, np.array([[MIDDLE - 0.6, 14.0], [MIDDLE + 0.6, 15.2]]))
    clump = bay & (mesh.triangles >= len(mesh.points) - 6).all(axis=1)
    assert clump.any()
    found = with_points_of(mesh, kept | clump, bay & ~clump)
    assert np.array_equal(open_gaps(mesh, ~found), ~found)
    assert len(np.unique(mesh.triangles[found])) > len(np.unique(mesh.triangles[kept]))
    assert len(np.unique(components_of(mesh.neighbors, found)[found])) == 1
