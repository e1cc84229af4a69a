"""What an annotation allows, a decorated function takes; everything else is one line."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt
import pytest
from typing_extensions import TypeAliasType

from o3dleaf.core.arguments.allowed import require
from o3dleaf.core.arguments.annotations import rule_of
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Finite, Limit, NotNegative, Order, Positive, Share, Unit, Whole
from o3dleaf.errors import InputError, UnitError


class Callback(Protocol):
    """A function of one argument."""

    def __call__(self, number: float) -> float: ...


ONE = np.array(1.0)
CASES = [
    (
        float,
        [1, 1.5, np.float32(2), np.int64(3), ONE, np.inf],
        ["1", None, np.nan, 1j, True, [1.0], 10**400, np.ones(1)],
    ),
    (int, [1, np.int16(2), -3], [1.0, "1", None, True, np.nan, 10**30]),
    (bool, [True, np.bool_(False)], [1, 0, None, "yes"]),
    (str, ["", "a"], [b"a", None, 3, "a\0b"]),
    (str | Path, ["a", Path("b")], [b"a", None, "", "a\0b"]),
    (float | None, [None, 1.0], ["None", "1"]),
    (TypeAliasType("Length", float), [1.0], ["1", None]),  # what `type Length = float` makes since Python 3.12
    (Literal["auto", False] | float, ["auto", False, 2], ["no", True, None]),
    (tuple[float, float], [(1, 2), [1.0, 2.0], np.ones(2)], [(1,), (1, 2, 3), "12", 1.0, (1, "2"), {1.0, 2.0}]),
    (Sequence[str], [("a",), ["b"], []], ["ab", ["a", 1], 3, {"a": 1}]),
    (Iterable[tuple[npt.ArrayLike, float]], [[([[0, 0], [1, 1]], 0.1)]], [[1], ["ab"], [([0], "x")]]),
    (Mapping[str, Any], [{}, {"a": 1}], [[], None, "a"]),
    (Callable[..., int], [len, lambda: 1], ["len", None, 3]),
    (Callback, [len, np.sin], ["sin", 3]),
    (UnitError, [UnitError("x")], [UnitError, "x", ValueError("x")]),
    (Positive, [1e-30, 1e30], [0, -1, np.inf, 1e-31, 1e31]),
    (NotNegative, [0, 1.0], [-1e-9, np.inf]),
    (Finite, [-1.0, 0], [np.inf, -np.inf]),
    (Limit, [1.0, np.inf], [0, -np.inf]),
    (Share, [0, 0.5, 1], [-0.1, 1.1]),
    (Count, [1, 10], [0, -1]),
    (Whole, [0, 1], [-1]),
    (Order, [0, 2], [3, -1]),
    (Unit, ["mm", "µm", "um"], ["furlong", "MM", "", 3]),
]


@pytest.mark.parametrize(("annotation", "good", "bad"), CASES, ids=lambda case: str(case)[:40])
def test_an_annotation_tells_what_is_taken(annotation, good, bad):
    rule = rule_of(annotation)
    for value in good:
        require(value, "it", rule)
    for value in bad:
        with pytest.raises(InputError, match=r"^it: is .*; give .*$"):
            require(value, "it", rule)


@pytest.mark.parametrize(
    "annotation",
    [
        Any,
        object,
        npt.ArrayLike,
        float | npt.ArrayLike,
        TypeAliasType("Rows", npt.ArrayLike),
        np.ndarray,
        npt.NDArray[Any],
    ],
)
def test_of_arrays_an_annotation_tells_nothing(annotation):
    assert rule_of(annotation) is None


def test_a_function_is_called_with_what_it_was_given():
    """It keeps its name and its defaults; a name that it has not is Python's own error."""

    @checked
    def scaled(values: npt.ArrayLike, factor: "Positive" = 2.0, *, unit: Unit | None = None) -> Any:
        """Return values by a factor."""
        return values, factor, unit

    given = [1, 2]
    assert scaled(given) == (given, 2.0, None)
    assert scaled(given, 3, unit="mm")[0] is given
    assert scaled.__doc__ == "Return values by a factor."
    with pytest.raises(InputError, match="factor: is 0; give a number above zero"):
        scaled(given, 0)
    with pytest.raises(UnitError, match=r"unit: is 'inch'; give one of m, .*nm \(an inch is 25.4 mm\) or None"):
        scaled(given, unit="inch")
    with pytest.raises(TypeError, match="furlong"):
        scaled(given, furlong=1)


def test_a_class_is_made_of_what_its_fields_allow():
    @checked
    @dataclass(frozen=True)
    class Box:
        width: Positive
        name: str = ""

    assert Box(1.0) == Box(1.0, "")
    with pytest.raises(InputError, match="name: is 3; give text"):
        Box(1.0, 3)
