"""Numbers in a temporary file are those in memory, and take none of it."""

import tempfile

import numpy as np
import pytest

from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.resources import machine, scratch
from o3dleaf.core.resources.budget import memory_limit


class Stored:
    """An array that is read by slices, and notes how much at once."""

    chunks = (3, 5, 7)

    def __init__(self, values):
        self.values, self.shape, self.dtype, self.most = values, values.shape, values.dtype, 0

    def __getitem__(self, where):
        part = self.values[where]
        self.most = max(self.most, part.nbytes)
        return part


def test_what_takes_too_much_of_the_memory_lies_in_a_file_that_nobody_sees(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with memory_limit(machine.resident() + 400_000_000):
        assert scratch.is_held(90_000_000)
        assert not scratch.is_held(120_000_000)
        few, many = (scratch.scratch_array((count,)) for count in (1000, 15_000_000))
    assert few.base is None
    assert isinstance(many.base, np.memmap)
    assert not list(tmp_path.iterdir())
    many[:] = 3.0
    machine.release_pages(many)
    assert many[0] == many[-1] == 3.0


def test_of_many_arrays_each_may_take_less_and_rows_are_made_some_at_a_time():
    """A 128th of 400 MB is 3.1 MB; whichever it is, the rows are those of one call."""
    with memory_limit(machine.resident() + 400_000_000):
        assert scratch.is_held(4_000_000)
        assert not scratch.is_held(4_000_000, scratch.EACH)
        for rows, mapped in ((100_001, False), (300_001, True)):
            asked = []

            def make(start, stop, asked=asked):
                asked.append(stop - start)
                return np.arange(2 * start, 2 * stop).reshape(-1, 2)

            array = scratch.made_by_rows((rows, 2), make, np.int64)
            np.testing.assert_array_equal(array, np.arange(2 * rows).reshape(-1, 2))
            assert isinstance(array.base, np.memmap) == mapped
            assert max(asked) == scratch.ROWS


@pytest.mark.parametrize("dtype", ["<u2", ">i4", "f4"])
def test_an_array_is_loaded_part_by_part(monkeypatch, dtype):
    values = np.random.default_rng(0).integers(0, 1000, (40, 30, 20)).astype(dtype)
    held, mapped = Stored(values), Stored(values)
    np.testing.assert_array_equal(scratch.load_array(held), values)
    monkeypatch.setattr(scratch, "is_held", lambda *_: False)
    monkeypatch.setattr(scratch, "PART", 1 << 13)
    found = scratch.load_array(mapped)
    np.testing.assert_array_equal(found, values)
    assert found.dtype == values.dtype
    assert isinstance(found.base, np.memmap)
    assert held.most == values.nbytes
    assert mapped.most <= max(1 << 13, 3 * values[0].nbytes)


def test_a_full_disk_is_named(monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(scratch, "is_held", lambda *_: False)
    monkeypatch.setattr(scratch, "claim", full)
    with pytest.raises(O3DLeafError, match="TMPDIR"):
        scratch.scratch_array((10,))


@pytest.mark.parametrize("held", [1 << 30, 9_000, 0])
def test_an_array_that_grows_is_its_parts_one_after_the_other(monkeypatch, tmp_path, held):
    """In memory, in a file from some part on, and from the first one: the same numbers, to be changed as one likes."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(scratch, "is_held", lambda size, *_: size <= held)
    rng = np.random.default_rng(0)
    parts = [rng.integers(0, 1000, (count, 3)) for count in (40, 0, 300, 7, 1000)]
    growing = scratch.GrowingArray(np.int32, (3,))
    for part in parts:
        growing.append(part)
    assert growing.rows == 1347
    whole = growing.whole()
    np.testing.assert_array_equal(whole, np.concatenate(parts))
    assert whole.dtype == np.int32
    assert isinstance(whole.base, np.memmap) == (held < 12 * 1347)
    whole += 1
    np.testing.assert_array_equal(whole, np.concatenate(parts) + 1)
    assert not list(tmp_path.iterdir())


def test_an_array_of_no_parts_is_empty():
    assert scratch.GrowingArray(np.float64, (2,)).whole().shape == (0, 2)


def test_a_disk_that_fills_up_under_a_growing_array_is_named(monkeypatch):
    class Full:
        def write(self, _):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(scratch, "is_held", lambda *_: False)
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: Full())
    with pytest.raises(O3DLeafError, match="TMPDIR"):
        scratch.GrowingArray(np.float64).append(np.ones(10))


@pytest.mark.parametrize("held", [True, False])
def test_rows_in_the_order_of_their_keys_are_those_of_a_stable_sort(monkeypatch, held):
    """By a second key, then by the first: the twin is `lexsort`."""
    monkeypatch.setattr(scratch, "is_held", lambda *_: held)
    monkeypatch.setattr(scratch, "ROWS", 100)
    rng = np.random.default_rng(0)
    first, second = rng.integers(0, 7, 1234), rng.integers(0, 40, 1234)
    order = scratch.order_of(first, scratch.order_of(second, np.arange(1234)))
    np.testing.assert_array_equal(order, np.lexsort((second, first)))
    assert isinstance(order.base, np.memmap) != held
    assert len(scratch.order_of(first[:0], order[:0])) == 0


@pytest.mark.parametrize("held", [True, False])
def test_parts_begin_where_those_before_them_end(monkeypatch, held):
    monkeypatch.setattr(scratch, "is_held", lambda *_: held)
    offsets = scratch.offsets_of(np.array([3, 0, 5], dtype=np.int64))
    np.testing.assert_array_equal(offsets, [0, 3, 3, 8])
    assert isinstance(offsets.base, np.memmap) != held
