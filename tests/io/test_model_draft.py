"""The coefficients of a fit lie in its model file from the start: the same bytes, written once, whole or not at all."""

import mmap
import sys

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.io.models import model_draft as draft_module
from o3dleaf.io.models import model_file
from o3dleaf.io.models.model_draft import HEAD, model_draft

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows does not rename a file that is mapped")


@pytest.fixture(autouse=True)
def small_is_large(monkeypatch):
    monkeypatch.setattr(draft_module, "LARGE", 1 << 12)


def fit(slope=1.0):
    x, y, z = np.meshgrid(*3 * [np.linspace(-1, 1, 36)], indexing="ij")
    return o3l.PUInterpolant.fit_lattice(np.sin(3 * x) + slope * y - z**2, spacing=0.5, smoothing=0.1)


def is_mapped(array):
    while array is not None and not isinstance(array, mmap.mmap):
        array = getattr(array, "base", None)
    return array is not None


def test_a_draft_has_the_bytes_of_a_file_that_is_written_at_once(tmp_path, monkeypatch):
    fit().save(tmp_path / "plain.o3l")
    write, already = model_file._write, []
    monkeypatch.setattr(model_file, "_write", lambda *given, **more: (already.append(more), write(*given, **more)))
    with model_draft(tmp_path / "draft.o3l"):
        field = fit()
        field.save(tmp_path / "draft.o3l")
        assert not (tmp_path / "draft.o3l").exists()
    assert already == [{"already": 1}]
    assert is_mapped(field.local.weights)
    assert (tmp_path / "draft.o3l").read_bytes() == (tmp_path / "plain.o3l").read_bytes()
    places = np.random.default_rng(0).uniform(0, 6.5, (50, 3))
    np.testing.assert_array_equal(o3l.load(tmp_path / "draft.o3l")(places), field(places))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["draft.o3l", "plain.o3l"]


def test_what_a_model_goes_to_elsewhere_or_what_is_not_its_own_array_is_written_as_ever(tmp_path):
    one, other = fit(), fit(2.0)
    one.save(tmp_path / "one.o3l")
    other.save(tmp_path / "other.o3l")
    with model_draft(tmp_path / "draft.o3l"):
        fit().save(tmp_path / "elsewhere.o3l")
        other.save(tmp_path / "draft.o3l")
    for name, twin in (("draft", "other"), ("elsewhere", "one")):
        assert (tmp_path / f"{name}.o3l").read_bytes() == (tmp_path / f"{twin}.o3l").read_bytes()
    assert len(list(tmp_path.iterdir())) == 4


def test_a_head_that_is_longer_than_the_room_for_it_is_written_as_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(draft_module, "HEAD", 1 << 9)
    assert HEAD > 1 << 9
    with model_draft(tmp_path / "draft.o3l"):
        field = fit()
        field.save(tmp_path / "draft.o3l")
    places = np.random.default_rng(0).uniform(0, 6.5, (50, 3))
    np.testing.assert_array_equal(o3l.load(tmp_path / "draft.o3l")(places), field(places))


@pytest.mark.parametrize("fails", [True, False])
def test_a_draft_that_no_model_comes_of_leaves_nothing_and_an_old_file_as_it_was(tmp_path, fails):
    target = tmp_path / "draft.o3l"
    target.write_bytes(b"old")

    def work():
        with model_draft(target):
            fit()
            if fails:
                raise KeyError

    if fails:
        with pytest.raises(KeyError):
            work()
    else:
        work()
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]
