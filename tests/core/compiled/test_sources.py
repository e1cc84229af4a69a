"""The stamp of a compiled module covers all compiled modules that it stands on, and nothing else."""

import pytest

from o3dleaf.core.compiled import sources


@pytest.fixture
def modules(monkeypatch):
    """Return texts of modules by name, in place of the package's own."""
    texts = {
        "o3dleaf.a_loops": "from o3dleaf.b_loops import f\nimport numpy as np\n",
        "o3dleaf.b_loops": "from o3dleaf.c_loops import g\nfrom o3dleaf.a_loops import h\n",
        "o3dleaf.c_loops": "ONE = 1\n",
        "o3dleaf.d_loops": "TWO = 2\n",
    }
    monkeypatch.setattr(sources, "_source", lambda name: texts[name].encode())
    sources.stamp.cache_clear()
    yield texts
    sources.stamp.cache_clear()


@pytest.mark.parametrize(("changed", "same"), [("a", False), ("b", False), ("c", False), ("d", True)])
def test_it_changes_with_what_is_imported_however_far(modules, changed, same):
    before = sources.stamp("o3dleaf.a_loops")
    modules[f"o3dleaf.{changed}_loops"] += "# changed\n"
    sources.stamp.cache_clear()
    assert (sources.stamp("o3dleaf.a_loops") == before) is same


def test_what_stands_below_does_not_know_what_stands_on_it(modules):
    before = sources.stamp("o3dleaf.c_loops")
    modules["o3dleaf.a_loops"] += "# changed\n"
    sources.stamp.cache_clear()
    assert sources.stamp("o3dleaf.c_loops") == before
