"""Progress by context: shares of shares, never back, silence, threads, and a journal that is open."""

import threading
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dleaf.core import journal as journals
from o3dleaf.core import progress
from o3dleaf.core.parallel import run_blocks


def listen():
    heard = []
    return heard, lambda done, total: heard.append(done / total)


def test_parts_of_parts_are_shares_of_the_whole():
    heard, listener = listen()
    with progress.listening(listener):
        first, second = progress.split(1, 3)
        with first:
            pass
        with second:
            early, late = progress.split(1, 1)
            with early:
                progress.report(1, 2)
            with late:
                progress.report(1, 3)
    assert heard == pytest.approx([1 / 4, 1 / 4 + 3 / 16, 1 / 4 + 3 / 8, 1 / 4 + 3 / 8 + 1 / 8, 1])


@given(
    shares=st.lists(st.floats(0.01, 100), min_size=1, max_size=5),
    reported=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 7), st.integers(0, 7)), max_size=30),
)
def test_steps_that_share_a_bar_never_move_it_back_and_the_last_ends_it(shares, reported):
    heard = []

    def work():
        steps = progress.split(*shares)
        for number, done, total in reported:
            steps[number % len(steps)].advance(min(done, total) / total if total else 1.0)
        with steps[-1]:
            pass
        return list(heard)

    with progress.listening(lambda *each: heard.append(each)):
        before_the_end = work()
    assert {total for _, total in heard} == {progress.WHOLE}
    assert all(one < other for (one, _), (other, _) in pairwise(heard))
    assert before_the_end[-1] == (progress.WHOLE, progress.WHOLE)


def test_it_never_goes_back_and_ends_at_one():
    heard, listener = listen()
    with progress.listening(listener):
        for done in (3, 1, 2, 4, 0):
            progress.report(done, 5)
    assert heard == [0.6, 0.8, 1.0]


def test_nobody_hears_what_is_silent_or_outside():
    heard, listener = listen()
    progress.report(1, 2)
    (alone,) = progress.split(1)
    with alone:
        progress.report(1, 2)
    with progress.listening(listener), progress.silent():
        assert not progress.is_heard()
        progress.report(1, 2)
    assert heard == [1.0]


def test_a_part_that_failed_is_not_done():
    heard, listener = listen()

    def work():
        with progress.listening(listener):
            progress.report(1, 4)
            raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        work()
    assert heard == [0.25]
    assert not progress.is_heard()


@pytest.mark.parametrize("reports", [True, False])
def test_blocks_report_from_the_calling_thread_if_they_are_asked_to(reports):
    heard, threads = [], set()

    def listener(done, total):
        heard.append(done / total)
        threads.add(threading.get_ident())

    with progress.listening(listener):
        run_blocks(lambda start, stop: None, 50, 1, reports=reports)
        before = list(heard)
    assert bool(before) == reports
    assert threads == {threading.get_ident()}
    assert np.all(np.diff(heard) > 0)


def test_steps_that_take_nothing_are_allowed():
    with progress.listening(lambda done, total: None):
        for part in progress.split(0, 0):
            with part:
                pass


def test_stages_and_notes_reach_the_open_journal_alone():
    class Noting(journals.Journal):
        def note(self, text):
            self.text = text

    heard, listener = listen()
    with progress.listening(listener), journals.stage("nobody"):
        journals.note("nobody")
        progress.report(1, 2)
    assert heard == [1.0]
    with Noting() as journal:
        with journals.stage("fit"):
            assert progress.is_heard()
        journals.note("done")
        assert journals.open_journal() is journal
    assert list(journal.seconds) == ["fit"]
    assert journal.text == "done"
    assert journals.open_journal() is None
