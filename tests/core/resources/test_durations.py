"""A duration is the same in words and in seconds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.durations import duration_in_words, parse_duration


@pytest.mark.parametrize(
    ("text", "seconds"), [("90s", 90), ("10 min", 600), (" 1.5h ", 5400), (".5d", 43200), (30, 30), (0.5, 0.5)]
)
def test_a_duration_is_read_as_it_is_meant(text, seconds):
    assert parse_duration(text) == seconds


@pytest.mark.parametrize("wrong", ["", "2", "min", "-2h", "0s", "2 h 10 min", "nan s", "1e3s", "2m", True, 0, -1.0])
def test_what_is_no_duration_is_refused(wrong):
    with pytest.raises(InputError, match="time: "):
        parse_duration(wrong)


@given(st.floats(0.1, 5e6))
def test_words_are_read_back_to_their_two_digits(seconds):
    assert parse_duration(duration_in_words(seconds)) == pytest.approx(seconds, rel=0.05, abs=0.06)
