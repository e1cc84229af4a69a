"""Pictures of commands are small here: how many pixels one has decides on nothing else."""

import pytest

from o3dleaf.output.view.picture import render


@pytest.fixture(autouse=True)
def _small_pictures(monkeypatch):
    monkeypatch.setitem(render.__wrapped__.__kwdefaults__, "size", (400, 250))
