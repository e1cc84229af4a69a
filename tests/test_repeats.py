"""Of the cases of a test marked `few`, the default run has each value of each argument."""

from types import SimpleNamespace

import pytest

from repeats import find_repeats

GIVEN = {"shape": ["ball", "block", "ring"], "noise": [0.0, 0.2], "seed": [1, 2, 3, 4]}


def cases(*axes, name="test_it", **limits):
    """Return what pytest collects of a test with stacked parameters, as far as it is looked at."""
    places = [{}]
    for axis in axes:
        rows = [*zip(*(GIVEN[each] for each in axis), strict=False)]
        places = [place | dict(zip(axis, row, strict=True)) for place in places for row in rows]
    marks = [SimpleNamespace(args=(",".join(axis), None)) for axis in axes]
    few = SimpleNamespace(kwargs=limits)
    return [
        SimpleNamespace(
            nodeid=f"{name}[{number}]",
            callspec=SimpleNamespace(params=place),
            iter_markers=lambda _: marks,
            get_closest_marker=lambda _: few,
        )
        for number, place in enumerate(places)
    ]


def shown(items):
    repeats = [*find_repeats(items)]
    return [item.callspec.params for item in items if item not in repeats]


def test_each_value_is_shown_in_as_few_cases_as_show_it():
    left = shown(cases(("shape",), ("noise",), ("seed",)))
    assert len(left) == 4
    assert {name: sorted({case[name] for case in left}) for name in GIVEN} == GIVEN


def test_of_an_argument_with_a_limit_the_first_values_are_shown():
    left = shown(cases(("shape",), ("seed",), seed=1))
    assert [case["seed"] for case in left] == [1, 1, 1]
    assert [case["shape"] for case in left] == GIVEN["shape"]


def test_values_that_are_given_together_stay_together():
    left = shown(cases(("shape", "seed"), ("noise",), shape=2))
    assert left == [{"shape": "ball", "seed": 1, "noise": 0.0}, {"shape": "block", "seed": 2, "noise": 0.2}]


def test_each_test_is_looked_at_by_itself():
    one, other = cases(("seed",), name="one", seed=1), cases(("seed",), name="other", seed=1)
    assert shown([*one, *other]) == [{"seed": 1}, {"seed": 1}]


def test_an_argument_that_is_none_is_refused():
    with pytest.raises(pytest.UsageError, match="test_it: `few` names sed, which"):
        shown(cases(("seed",), sed=1))
