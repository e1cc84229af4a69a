"""The decorator of public functions, and of classes that a user makes: their arguments are what annotations allow."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from o3dleaf.core.arguments.allowed import PATH, Allowed, require
from o3dleaf.core.arguments.annotations import rules_of
from o3dleaf.core.errors import InputError

SEVERAL = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
"""Kinds of parameters whose annotation is that of each argument, and is left to the function."""

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
            bound = signature.bind(*given, **named).arguments
        except TypeError:  # a name that there is not: Python's own words are good
            return thing(*given, **named)
        _require_order(thing.__name__, bound, rules)
        for name, rule in rules.items():
            if name in bound:
                require(bound[name], name, rule)
        return thing(*given, **named)

    return cast(Thing, call)


def _require_order(function: str, bound: dict[str, Any], rules: dict[str, Allowed]) -> None:
    """Raise `InputError` if a path stands first and what is written second, as Open3D has it."""
    first, second = (*bound, None, None)[:2]
    if first is None or second is None or rules.get(second) is not PATH or rules.get(first) is PATH:
        return
    if PATH.allows(bound[first]) and not PATH.allows(bound[second]):
        raise InputError(f"{function}: takes the {first} first, then the path; call {function}({first}, {second})")
