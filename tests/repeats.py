"""Which cases of a test repeat what others of it hold: those run with --slow alone."""

from collections import defaultdict

import pytest


def find_repeats(items):
    """Yield the cases that are left of tests marked `few` when each value of each argument has been shown once.

    The marker says of how many values of an argument that is so: `few(seed=1)` shows the first seed alone. Arguments
    whose values are given together are one.
    """
    families = defaultdict(list)
    for item in items:
        if item.get_closest_marker("few"):
            families[item.nodeid.partition("[")[0]].append(item)
    for name, cases in families.items():
        axes, limits = axes_of(cases[0]), cases[0].get_closest_marker("few").kwargs
        if unknown := sorted(limits.keys() - {name for axis in axes for name in axis}):
            raise pytest.UsageError(f"{name}: `few` names {', '.join(unknown)}, which the test is not parametrized by")
        values = [tuple(tuple(id(case.callspec.params[name]) for name in axis) for axis in axes) for case in cases]
        orders = [list(dict.fromkeys(column)) for column in zip(*values, strict=True)]
        sizes = [
            min([len(order), *(limits[n] for n in axis if n in limits)])
            for axis, order in zip(axes, orders, strict=True)
        ]
        shown = {
            tuple(order[row % size] for order, size in zip(orders, sizes, strict=True)) for row in range(max(sizes))
        }
        yield from (case for case, value in zip(cases, values, strict=True) if value not in shown)


def axes_of(item):
    """Return names of arguments, those together whose values are given together."""
    given = [mark.args[0] for mark in item.iter_markers("parametrize")]
    axes = [tuple(name.strip() for name in (names.split(",") if isinstance(names, str) else names)) for names in given]
    told = {name for axis in axes for name in axis}
    return [*axes, *((name,) for name in item.callspec.params if name not in told)]
