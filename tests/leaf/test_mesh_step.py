"""The step of a mesh follows from the data, and not from the unit that they are in."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import METERS, unit_scale
from o3dleaf.leaf.mesh_step import choose_step
from tolerances import SPACING_OF_A_LATTICE

LATTICE = np.stack(np.meshgrid(np.arange(60), np.arange(40), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("unit", METERS)
@pytest.mark.parametrize("thickness_mm", [None, 0.48, 20.0])
def test_the_step_is_the_same_length_in_any_unit(unit, thickness_mm):
    scale = unit_scale("mm", unit)
    one = choose_step(0.3 * LATTICE, thickness_mm)
    other = choose_step(0.3 * scale * LATTICE, None if thickness_mm is None else thickness_mm * scale)
    assert other.length == pytest.approx(one.length * scale, rel=1e-12)
    assert other.reason == one.reason


def test_a_scan_alone_is_meshed_at_its_own_spacing():
    length = choose_step(0.3 * LATTICE, None).length
    assert length == pytest.approx(0.3, rel=SPACING_OF_A_LATTICE)
    assert length == float(f"{length:.1e}")


def test_what_is_finer_decides():
    """The samples' patch, 0.48 mm high, is shown at 0.1 mm; a scan that is finer still keeps its own spacing."""
    assert choose_step(0.3 * LATTICE, 0.48).length == 0.1
    assert choose_step(0.03 * LATTICE, 0.48) == choose_step(0.03 * LATTICE, None)


@pytest.mark.slow
def test_the_step_of_a_piece_is_that_of_its_own_points():
    """A leaf of a quarter of the points of another one, far off: its step is twice as long."""
    leaf = o3l.samples.leaf_shape("curled", length=40, width=16)
    dense, sparse = (o3l.samples.scan_leaf(leaf, spacing=each, seed=3).points for each in (0.5, 1.0))
    scan = np.concatenate([dense, sparse + [0, 60, 0]])
    blade = o3l.create_blade(scan, unit="mm", options=o3l.BladeOptions(piece=2))
    step = choose_step(scan, None, blade)
    assert step.length == choose_step(sparse, None).length
    assert step.reason == "the piece's median point spacing"
    assert choose_step(scan, None).length == pytest.approx(0.5, rel=SPACING_OF_A_LATTICE)


def test_points_in_a_line_have_no_spacing():
    with pytest.raises(InputError, match="line"):
        choose_step(LATTICE * [1.0, 0.0, 0.0], None)
