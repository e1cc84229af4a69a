"""The decorator of public functions, and of classes that a user makes: their arguments are what annotations allow."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from o3dleaf.core.arguments.allowed import Allowed, require
from o3dleaf.core.arguments.annotations import rules_of

Thing = TypeVar("Thing", bound=Callable[..., Any])


def checked(thing: Thing) -> Thing:
    """Return a function, or a class, that raises `InputError` for arguments which its annotations do not allow."""
    if isinstance(thing, type):
        thing.__init__ = checked(thing.__init__)  # type: ignore[misc]
        return thing
    signature = inspect.signature(thing)
    rules: dict[str, Allowed] | None = None

    @wraps(thing)
    def call(*given: Any, **named: Any) -> Any:
        nonlocal rules
        if rules is None:
            rules = rules_of(thing)
        try:
            bound = signature.bind(*given, **named).arguments
        except TypeError:  # a name that there is not: Python's own words are good
            return thing(*given, **named)
        for name, rule in rules.items():
            if name in bound:
                require(bound[name], name, rule)
        return thing(*given, **named)

    return cast(Thing, call)
