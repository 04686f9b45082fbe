"""Values held against annotations: what a type checker would refuse is refused at run time too."""

import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cache, wraps
from inspect import signature
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import (
    Any,
    Final,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError

_PLAIN: Final[dict[Any, tuple[tuple[type, ...], str]]] = {
    bool: ((bool, np.bool_), "True or False"),
    int: ((Integral,), "a whole number"),
    float: ((Real,), "a number"),
    str: ((str,), "a text"),
    type(None): ((type(None),), "None"),
    Path: ((Path,), "a path"),
    PathLike: ((PathLike,), "a path"),
}
"""Annotation -> what may stand for it, and its name for people. A truth value is no number."""


P = ParamSpec("P")
R = TypeVar("R")


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that checks its arguments against its annotations.

    An annotation that is a text is not checked. A wrong argument is a ContractError.
    """
    hints, parameters = function.__annotations__, signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in parameters.bind(*args, **kwargs).arguments.items():
            check_value(name, value, hints[name])
        return function(*args, **kwargs)

    return call


def check_fields(record: Any) -> None:
    """Check the fields of a dataclass against their annotations.

    Raises:
        ContractError: Names the first field whose value is of another type.
    """
    hints = hints_of(record.__class__)
    for field in fields(record):
        check_value(field.name, getattr(record, field.name), hints[field.name])


def check_value(name: str, value: object, hint: Any) -> None:
    """Check one value of a caller against an annotation.

    Args:
        name: Of the parameter.
        value: What was given.
        hint: Of the standard types, literals, tuples, unions and classes; of others any value
            passes.

    Raises:
        ContractError: If the value is of another type.
    """
    if not _fits(value, hint):
        raise ContractError(f"{option_text(name)} must be {_name_of(hint)}; got {value!r}")


@cache
def hints_of(record: Any) -> Mapping[str, Any]:
    """Return the annotations of a class."""
    return get_type_hints(record)


def _fits(value: object, hint: Any) -> bool:
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is Literal:
        return any(type(value) is type(part) and value == part for part in parts)
    if origin is tuple:
        return _fits_tuple(value, parts)
    if origin is Sequence:
        return _fits_tuple(value, (*parts, Ellipsis))
    if origin is PathLike:
        return isinstance(value, PathLike)
    if origin in (Callable, Mapping) or hint is Any or not isinstance(hint, type):
        return True
    allowed = _PLAIN[hint][0] if hint in _PLAIN else (hint,)
    is_truth = isinstance(value, bool | np.bool_)
    return isinstance(value, allowed) and (not is_truth or hint in (bool, object))


def _fits_tuple(value: object, parts: tuple[Any, ...]) -> bool:
    if not isinstance(value, Sequence) or isinstance(value, str | bytes):
        return False
    if parts[-1:] == (Ellipsis,):
        return all(_fits(one, parts[0]) for one in value)
    return len(value) == len(parts) and all(map(_fits, value, parts))


def _name_of(hint: Any) -> str:
    """Return the name of a type for people."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        rest = [_name_of(part) for part in parts if part is not type(None)]
        return " or ".join(rest)
    if origin is Literal:
        return f"one of {', '.join(map(str, parts))}"
    if origin is tuple:
        return f"({', '.join(_name_of(part) for part in parts)})"
    if origin is Sequence:
        return f"several of: {_name_of(*parts)}"
    if origin is PathLike:
        return "a path"
    return _PLAIN[hint][1] if hint in _PLAIN else getattr(hint, "__name__", str(hint))
