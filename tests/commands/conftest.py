"""Commands run as a user's do, on all cores, but that their pictures are small: pixels decide on nothing else."""

import os

import pytest

from o3dleaf.core.parallel import set_num_threads


@pytest.fixture(autouse=True)
def _small_pictures(small_pictures):
    pass


@pytest.fixture(autouse=True)
def _all_cores(_threads_are_given_back):
    set_num_threads(os.cpu_count() or 1)
