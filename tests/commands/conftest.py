"""Commands run as a user's do, on all cores, but that their pictures are small: pixels decide on nothing else."""

import os

import pytest

from o3dleaf.core.parallel import set_num_threads
from o3dleaf.output.view.picture import render


@pytest.fixture(autouse=True)
def _small_pictures(monkeypatch):
    monkeypatch.setitem(render.__wrapped__.__kwdefaults__, "size", (400, 250))


@pytest.fixture(autouse=True)
def _all_cores(_threads_are_given_back):
    set_num_threads(os.cpu_count() or 1)
