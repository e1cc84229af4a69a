"""A size is the same in words and in bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.sizes import parse_size, size_in_words


@pytest.mark.parametrize(
    ("text", "size"),
    [("2GB", 2e9), ("500 MB", 5e8), (" 1.5 gib ", 1.5 * 2**30), ("2G", 2e9), (".5TB", 5e11), (10**9, 1e9)],
)
def test_a_size_is_read_as_it_is_meant(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize("wrong", ["", "2", "GB", "-2GB", "2 GB GB", "2PB", "nanGB", "1e3GB", "9MBit", True, 0, "3kB"])
def test_what_is_no_size_is_refused_with_one_that_is(wrong):
    with pytest.raises(InputError, match=r"memory: .*; give a size .*2GB"):
        parse_size(wrong)


@given(st.integers(10**6, 10**14))
def test_words_are_read_back_to_their_two_digits(size):
    assert parse_size(size_in_words(size).replace(",", "")) == pytest.approx(size, rel=0.05)
