"""What is listed is compiled once, by processes of their own, into a folder or where Numba keeps its own."""

import warnings

import pytest

from o3dleaf.core import progress
from o3dleaf.core.compiled import code_cache, signatures, warm_up
from o3dleaf.core.errors import CodeWarning
from o3dleaf.fitting.rbf import radial_loops

LINES = [
    "o3dleaf.fitting.rbf.radial_loops.dot Array(float64, 1, 'C'), Array(float64, 1, 'C'), int64",
    "o3dleaf.fitting.rbf.radial_loops.put Array(float64, 1, 'C'), Array(float64, 1, 'C')",
    "o3dleaf.fitting.local.weight_loops.wendland float64",
]


@pytest.fixture
def lines(monkeypatch):
    monkeypatch.setattr(signatures, "listed", lambda jobs: LINES)


def test_it_compiles_once_and_says_how_far_it_is(lines, tmp_path):
    heard = []
    with progress.listening(lambda done, total: heard.append(done / total)):
        assert warm_up.warm_up(tmp_path, workers=1) == len(LINES)
    assert len(list(tmp_path.glob("*.code"))) == len(LINES)
    assert heard[-1] == 1.0
    assert len(heard) > 1
    assert warm_up.warm_up(tmp_path, workers=1) == 0


@pytest.mark.slow
def test_a_shipped_folder_holds_what_python_calls_and_what_it_is_for(lines, tmp_path, monkeypatch):
    """Made by two processes, as on two cores."""
    monkeypatch.setattr(warm_up.os, "cpu_count", lambda: 2)
    warm_up._ship(tmp_path)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".code"] * len(LINES) + [".txt"]
    monkeypatch.setattr(code_cache, "SHIPPED", tmp_path)
    function, signature = signatures.read(LINES[1])
    loaded = code_cache.CodeCache(function.py_func).load_overload(signature, function.targetctx)
    assert loaded is not None
    assert (
        str(loaded.signature)
        == "(Array(float64, 1, 'C', False, aligned=True), Array(float64, 1, 'C', False, aligned=True)) -> none"
    )


@pytest.fixture
def untold(tmp_path, monkeypatch):
    """Nothing was said yet, no code came with the package, and what is compiled can be kept."""
    tellers = code_cache._tell_other_processor, code_cache._tell_not_kept
    monkeypatch.setattr(code_cache, "SHIPPED", tmp_path)
    monkeypatch.setattr(code_cache, "_writable_folder", lambda function: tmp_path)
    for each in tellers:
        each.cache_clear()
    yield
    for each in tellers:
        each.cache_clear()


def find_nothing():
    """Look for code that there is not."""
    _, signature = signatures.read(LINES[0])
    assert code_cache.CodeCache(radial_loops.dot.py_func).load_overload(signature, radial_loops.dot.targetctx) is None


def check_told_once(words):
    with pytest.warns(CodeWarning, match=words):
        find_nothing()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        find_nothing()


def test_code_for_something_else_is_not_loaded_and_a_line_says_so(untold, tmp_path):
    (tmp_path / code_cache.MADE_FOR).write_text("Numba 0.67.0, x86-64-v9")
    check_told_once(r"is for Numba 0.67.0, x86-64-v9, not for .*o3dleaf warm-up")


def test_where_no_code_can_be_kept_a_line_says_so(untold, monkeypatch):
    monkeypatch.setattr(code_cache, "_writable_folder", lambda function: None)
    check_told_once(r"cannot be kept .*NUMBA_CACHE_DIR")


def test_where_no_code_came_with_the_package_nothing_is_said(untold):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        find_nothing()
