"""A need is refused with its numbers, and a step that is not."""

import pytest

from o3dleaf.core.errors import MemoryBudgetError, TimeBudgetError
from o3dleaf.core.parallel import get_num_threads
from o3dleaf.core.resources import machine, needs
from o3dleaf.core.resources.budget import time_limit
from o3dleaf.core.resources.measured import Each
from o3dleaf.core.resources.needs import Need, need_of, require_resources


def test_the_line_says_need_room_and_a_step_that_is_not_refused(monkeypatch):
    monkeypatch.setattr(needs, "usable_memory", lambda: machine.Limit(10**9, "as stated", "state more"))

    def need(step):
        return Need(round(80 / step**3), f"step: {step**-3:,.0f} particles", "give a larger one", step, 3)

    with pytest.raises(MemoryBudgetError, match=r"need about 80 GB of memory, and 1\.0 GB more") as refused:
        need(1e-3).require()
    larger = float(str(refused.value).split("give a larger one, ")[1].split(" or more")[0])
    assert 1.0 < larger / 1e-3 / 80 ** (1 / 3) < 1.1
    need(larger).require()


def test_what_takes_longer_than_was_stated_is_refused_with_a_step_that_is_not():
    def need(step):
        cost = Each(1, 1e6) * (100 / step**2)
        return need_of(cost, f"step: {100 / step**2:,.0f} triangles", "give a larger one", step=step)

    need(1e-3).require()  # nothing was stated
    with time_limit("10min"):
        need(1.0).require()
        with pytest.raises(TimeBudgetError, match=r"take about .*, and 10 min are allowed; .*--time") as refused:
            need(0.1).require()
        larger = float(str(refused.value).split("give a larger one, ")[1].split(" or more")[0])
        need(larger).require()
        with pytest.raises(TimeBudgetError):
            need(larger / 1.2).require()
    assert need(0.1).elapsed == pytest.approx(1.3e4 / get_num_threads())


def test_bytes_alone_take_no_time():
    with time_limit(1e-9):
        require_resources(1.0, "work: 1 thing", "do less")
