"""Texts of a command line, as numbers."""

from o3dleaf.core.errors import InputError


def number_or_word(text: str) -> float | str:
    """Return a number for a text that is one."""
    try:
        return float(text)
    except ValueError:
        return text


def words_of(text: str) -> list[str]:
    """Return the words of a text, between commas or blanks."""
    return text.replace(",", " ").split()


def place_of(text: str) -> tuple[float | str, ...]:
    """Return the coordinates in a text, between commas or blanks."""
    return tuple(number_or_word(word) for word in words_of(text))


def corners_of(numbers: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the lower and the upper corner of a box whose numbers stand in a row."""
    half = len(numbers) // 2
    return numbers[:half], numbers[half:]


def windows_of(texts: list[str]) -> tuple[tuple[float, ...], ...]:
    """Return the five numbers of each text, or raise `InputError`."""
    rows = [(text, [number_or_word(word) for word in words_of(text)]) for text in texts]
    for text, row in rows:
        if len(row) != 5 or any(isinstance(each, str) for each in row):
            raise InputError(f"fine: is {text!r}; give five numbers, 'ALONG0 ACROSS0 ALONG1 ACROSS1 STEP'")
    return tuple(tuple(map(float, row)) for _, row in rows)
