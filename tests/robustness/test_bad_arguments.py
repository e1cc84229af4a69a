"""Every public callable, every argument, every kind of bad value: the right answer, or one line of ours."""

import inspect
import warnings

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf import samples, view
from o3dleaf.errors import O3DLeafError
from robustness.doors import DOORS
from robustness.left_out import INNER, RECORDS, UNCHANGED
from robustness.rows import answer, good_arguments, outcome, parts, rows_of
from robustness.world import World

FEWEST_ROWS = 1500
NAMESPACES = {"": (o3l, o3l.__all__), "samples.": (samples, samples.__all__), "view.": (view, view.__all__)}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield World(tmp_path_factory.mktemp("files"))


def public_callables():
    """What a user calls, by name, with the names of its arguments: functions, classes and their methods."""
    for prefix, (module, names) in NAMESPACES.items():
        for name in names:
            thing = getattr(module, name)
            if inspect.isclass(thing):
                if prefix + name not in RECORDS:
                    yield prefix + name, thing.__init__
                for method, function in inspect.getmembers(thing, callable):
                    if method == "__call__" or not method.startswith("_"):
                        yield f"{prefix}{name}.{method}", function
            elif callable(thing) and prefix + name not in RECORDS:
                yield prefix + name, thing


def arguments_of(function):
    parameters = inspect.signature(function).parameters.values()
    return {each.name for each in parameters if each.name not in {"self", "cls", *UNCHANGED}}


def test_the_table_has_every_public_argument():
    """Whatever takes an argument is a door, or a method of a door's class that stands elsewhere, or inner, and why."""
    methods = {name.split(".")[-1] for name in DOORS} | set(INNER)
    for name, function in public_callables():
        wanted = arguments_of(function)
        if not wanted or name.split(".")[-1] in INNER:
            continue
        if name in DOORS:
            assert set(DOORS[name].arguments) == wanted, name
        else:
            assert name.split(".")[-1] in methods, f"{name}: is in no row"


def test_the_table_is_long_enough():
    rows = [str(row) for name in DOORS for row in rows_of(name)]
    assert len(rows) == len(set(rows)) >= FEWEST_ROWS


def faults(name, world, *, slow):
    """What is wrong in the rows of a door."""
    door = DOORS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            good = [] if door.slow and not slow else [*parts(answer(door, good_arguments(door, world), world))]
        except O3DLeafError as cause:  # pragma: no cover - then the table is wrong
            return {name: f"the good call is refused: {cause}"}
        rows = [row for row in rows_of(name) if (row.kind != "bad" if slow else row.kind == "bad" or not door.slow)]
        found = {str(row): outcome(row, world, good) for row in rows}
    return {row: fault for row, fault in found.items() if fault}


@pytest.mark.slow
@pytest.mark.parametrize("name", DOORS)
def test_bad_arguments_are_refused_in_one_line(world, name):
    assert faults(name, world, slow=False) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, door in DOORS.items() if door.slow])
def test_odd_arguments_are_answered_or_refused(world, name):
    """Of what takes long: other forms of good arguments, and those that may be either."""
    assert faults(name, world, slow=True) == {}
