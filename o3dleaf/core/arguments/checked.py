"""The decorator of public functions, and of classes that a user makes: their arguments are what annotations allow."""

import inspect
from collections.abc import Callable, Collection, Mapping
from functools import wraps
from typing import Any, TypeVar, cast

from o3dleaf.core.arguments.allowed import PATH, Allowed, plain, require
from o3dleaf.core.arguments.annotations import rules_of
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError

SEVERAL = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
"""Kinds of parameters whose annotation is that of each argument: it is left to the function that they go on to, which
is checked itself; `require_known` holds their names to it."""

Thing = TypeVar("Thing", bound=Callable[..., Any])


def checked(thing: Thing) -> Thing:
    """Return a function, or a class, that raises `InputError` for arguments which its annotations do not allow."""
    if isinstance(thing, type):
        thing.__init__ = checked(thing.__init__)  # type: ignore[misc]
        return thing
    signature = inspect.signature(thing)
    several = {each.name for each in signature.parameters.values() if each.kind in SEVERAL}
    rules: dict[str, Allowed] | None = None

    @wraps(thing)
    def call(*given: Any, **named: Any) -> Any:
        nonlocal rules
        if rules is None:
            rules = {name: rule for name, rule in rules_of(thing).items() if name not in several}
        try:
            bound = signature.bind(*given, **named)
        except TypeError:  # a name that there is not: Python's own words are good
            return thing(*given, **named)
        values = bound.arguments
        _require_order(thing.__name__, values, rules)
        for name, rule in rules.items():
            if name in values:
                require(values[name], name, rule)
                values[name] = plain(values[name])
        return thing(*bound.args, **bound.kwargs)

    return cast(Thing, call)


def require_known(given: Mapping[str, Any], function: Callable[..., Any], *, but: Collection[str] = ()) -> None:
    """Raise `InputError` for names of options that go on to a function and are none of its, or are in `but`."""
    known = [name for name in inspect.signature(function).parameters if name not in {"self", *but}]
    for name in given:
        require_choice(name, known, "options")


def _require_order(function: str, bound: dict[str, Any], rules: dict[str, Allowed]) -> None:
    """Raise `InputError` if a path stands first and what is written second, as Open3D has it."""
    first, second = (*bound, None, None)[:2]
    if first is None or second is None or rules.get(second) is not PATH or rules.get(first) is PATH:
        return
    if PATH.allows(bound[first]) and not PATH.allows(bound[second]):
        raise InputError(f"{function}: takes the {first} first, then the path; call {function}({first}, {second})")
