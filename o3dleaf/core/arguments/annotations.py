"""What an annotation allows; nothing is said of arrays, which come in too many forms."""

import inspect
import types
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from os import PathLike
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.allowed import PATH, SIMPLE, Allowed
from o3dleaf.core.errors import InputError


def _unaliased(annotation: Any) -> Any:
    """Return what a name stands for that a `type` statement made, as NumPy's are since Python 3.12."""
    return getattr(annotation, "__value__", annotation)


ARRAY_LIKE = frozenset(get_args(_unaliased(npt.ArrayLike)))
"""Members of what `core.checks` makes clean arrays of."""
COUNTS = {1: "one", 2: "two", 3: "three", 4: "four"}


def rules_of(function: Callable[..., Any]) -> dict[str, Allowed]:
    """Return the rules of a function's parameters, by name; annotations that tell nothing have none."""
    known: dict[str, Allowed] = {}
    function = inspect.unwrap(function)
    for name, annotation in inspect.get_annotations(function).items():
        rule = None if name == "return" else rule_of(_meaning(annotation, function))
        if rule is not None:
            known[name] = rule
    return known


def _meaning(annotation: Any, function: Callable[..., Any]) -> Any:
    """Return an annotation with what stands in quotes read; Any where only type checkers import its names."""
    quoted = types.SimpleNamespace(__annotations__={"it": annotation})
    try:
        return get_type_hints(quoted, getattr(function, "__globals__", {}), include_extras=True)["it"]
    except NameError:
        return Any if isinstance(annotation, str) else annotation


def rule_of(annotation: Any) -> Allowed | None:
    """Return the rule of an annotation, or None where values of it cannot be told from others."""
    annotation = _unaliased(annotation)
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin in {Union, types.UnionType}:
        return None if {*inner} >= ARRAY_LIKE else _any_of(inner)
    if origin is Annotated:
        return next((each for each in inner if isinstance(each, Allowed)), rule_of(inner[0]))
    if origin is Literal:
        return _one_of(inner)
    if origin is tuple and inner[-1:] != (...,):
        return _row_of(inner)
    return SIMPLE[annotation] if annotation in SIMPLE else _of_kind(origin or annotation, inner)


def _of_kind(kind: Any, inner: tuple[Any, ...]) -> Allowed | None:
    """Return the rule of a class, or of several values; arrays have none, nor have protocols that are not told."""
    rule = None
    if kind is Callable or _is_protocol_of_functions(kind):
        rule = Allowed(callable, "a function")
    elif kind in {Sequence, Iterable, Collection, tuple, list}:
        rule = _several(inner)
    elif isinstance(kind, type) and issubclass(kind, PathLike):
        rule = PATH
    elif (
        isinstance(kind, type) and kind not in {np.ndarray, object, Any} and (_is_told(kind) or not _is_protocol(kind))
    ):
        name = {"Mapping": "dict"}.get(kind.__name__, kind.__name__)
        article = "an" if name[0] in "AEIOU" else "a"
        rule = Allowed(lambda value: isinstance(value, kind) and not isinstance(value, type), f"{article} {name}")
    return rule


def _is_protocol(kind: Any) -> bool:
    return bool(getattr(kind, "_is_protocol", False))


def _is_told(kind: Any) -> bool:
    """Return whether objects can be asked if they are of a kind."""
    return not _is_protocol(kind) or bool(getattr(kind, "_is_runtime_protocol", False))


def _is_protocol_of_functions(kind: Any) -> bool:
    return _is_protocol(kind) and not _is_told(kind) and "__call__" in vars(kind)


def _one_of(values: tuple[Any, ...]) -> Allowed:
    """Return the rule of a few values."""
    return Allowed(
        lambda value: any(type(value) is type(each) and value == each for each in values),
        " or ".join(map(repr, values)),
    )


def _any_of(members: tuple[Any, ...]) -> Allowed | None:
    """Return the rule of a union: one of its members; a path may be text."""
    rules = [rule_of(each) for each in members]
    known = [rule for rule in rules if rule is not None]
    if len(known) < len(rules):
        return None
    if PATH in known:
        known = [rule for rule in known if rule is not SIMPLE[str]]
    if len(known) == 1:
        return known[0]
    words = [rule.words for rule in known]
    return Allowed(
        lambda value: any(rule.allows(value) for rule in known),
        ", ".join(words[:-1]) + " or " * (len(words) > 1) + words[-1],
        next((rule.error for rule in known if rule.error is not InputError), InputError),
    )


def _row_of(members: tuple[Any, ...]) -> Allowed | None:
    """Return the rule of some values in a row, such as two numbers."""
    rules = [rule_of(each) for each in members]
    if not any(rules):
        return None

    def allows(value: Any) -> bool:
        return (
            isinstance(value, list | tuple | np.ndarray)
            and getattr(value, "ndim", 1) != 0
            and len(value) == len(rules)
            and all(rule is None or rule.allows(each) for rule, each in zip(rules, value, strict=True))
        )

    words = rules[0].words if rules[0] is not None and len(set(members)) == 1 else "value"
    return Allowed(allows, f"{COUNTS.get(len(rules), len(rules))} {words.removeprefix('a ')}s")


def _several(members: tuple[Any, ...]) -> Allowed:
    """Return the rule of any number of values; text and tables are none."""
    rule = rule_of(members[0]) if members else None

    def allows(value: Any) -> bool:
        if isinstance(value, str | bytes | Mapping | type) or not isinstance(value, Iterable):
            return False
        return rule is None or not isinstance(value, Sequence | np.ndarray) or all(rule.allows(each) for each in value)

    return Allowed(allows, "a list" if rule is None else f"a list, each of it {rule.words}")
