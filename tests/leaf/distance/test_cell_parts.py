"""Theorems of parts of cells: they divide each cell, where the thickness falls, into squares as good as straight."""

import numpy as np
import pytest

from leaf_fields import leaf_of
from leaf_fields import texture as texture_of
from o3dleaf import Margin, MultiscaleLeaf, ParametricBlade
from o3dleaf.leaf.distance.cell_parts import divide_cells
from o3dleaf.leaf.distance.tile_samples import STRAIGHT, TileSamples

RING = np.array([[2.0, -2], [18, -2], [18, 2], [2, 2]])
RADIUS = 0.3


def leaf_with(radius):
    slab = texture_of(lambda x, y, z: 0.2 - np.abs(z) + 0 * x * y)
    surface = leaf_of(slab, bend=15.0)[0].blade.surface
    return MultiscaleLeaf(slab, blade=ParametricBlade(surface, Margin(RING, RING, spacing=0.25), rim_radius=radius))


@pytest.fixture(scope="module")
def divided():
    leaf = leaf_with(RADIUS)
    tile = TileSamples.sample(leaf)
    first, last = np.floor((leaf.blade.outline.bounds - tile.origin) / tile.cell).astype(np.int64)
    corners = np.stack(np.meshgrid(*map(np.arange, first, last + 1), indexing="ij"), axis=-1).reshape(-1, 2)
    return leaf, tile, corners, divide_cells(leaf, tile, corners)


def test_every_place_of_a_cell_lies_in_one_part(divided):
    _, _, corners, parts = divided
    assert np.bincount(parts.cells, parts.side**2).tolist() == [1.0] * len(corners)
    shares = np.random.default_rng(0).random((500, 2))
    cell = parts.cells[~parts.is_whole][0]
    rows = np.flatnonzero(parts.cells == cell)
    assert len(rows) > 4
    assert np.sum([parts.contains(row, shares) for row in rows], axis=0).tolist() == [1] * len(shares)
    # What rounding puts on the last side, too.
    assert sum(parts.contains(row, np.ones((1, 2)))[0] for row in rows) == 1


def test_parts_are_straight_or_as_small_as_samples_are_apart(divided):
    leaf, tile, corners, parts = divided
    rng, large = np.random.default_rng(1), np.flatnonzero(parts.side * tile.cell.max() > tile.step)
    middle = np.pad(tile.origin + (corners[parts.cells] + 0.5 + parts.offsets) * tile.cell, ((0, 0), (0, 1)))[large]
    lifted = leaf.blade.lift_with_jacobian(middle)
    for _ in range(20):
        off = np.pad(
            rng.uniform(-0.5, 0.5, (len(large), 2)) * parts.side[large, np.newaxis] * tile.cell, ((0, 0), (0, 1))
        )
        off[:, 2] = rng.uniform(*leaf.heights)
        copy = lifted.world + np.einsum("ni,nik->nk", off, lifted.columns)
        bend = np.linalg.norm(leaf.blade.lift(middle + off) - copy, axis=1)
        tapered = leaf.blade.rim.values(middle[:, :2]) < 1
        assert np.quantile(bend[tapered], 0.99) < 2 * STRAIGHT * tile.step


def test_cells_away_from_a_rim_and_all_without_one_are_whole(divided):
    _, tile, corners, parts = divided
    depth = 2 - np.abs(tile.origin[1] + (corners[:, 1] + 0.5) * tile.cell[1])
    away = depth > RADIUS + 2 * tile.cell.max()
    ends = tile.origin[0] + (corners[:, 0] + 0.5) * tile.cell[0]
    away &= (ends > 4) & (ends < 16)
    assert away.any()
    assert parts.is_whole[np.isin(parts.cells, np.flatnonzero(away))].all()
    plain = divide_cells(leaf_with(None), tile, corners)
    assert plain.is_whole.all()
    assert plain.cells.tolist() == list(range(len(corners)))
    assert not plain.offsets.any()
