"""Objects to plain data and back, so that a run folder says, and can rebuild, what was run."""

import dataclasses
import hashlib
import importlib
import inspect
from collections.abc import Callable
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np


class ForeignTypeError(ValueError):
    """A description holds an object that only a study script can make: of its own class, or a function."""


def describe(value: Any) -> Any:
    """``value`` as JSON data: numbers, text, lists, and for an object its type with what it was constructed from.

    An object is a dataclass, or one whose constructor arguments are attributes of the same names. A function is told
    from others by its code and the values that it uses, a symbolic expression by its text.
    """
    match value:
        case None | bool() | int() | float() | str():
            return value
        case np.generic() | np.ndarray():
            return value.tolist()
        case list() | tuple():
            return [describe(item) for item in value]
        case dict():
            return {str(key): describe(item) for key, item in value.items()}
    if inspect.isfunction(value):
        return {"type": _public_name(value), **_body(value)}
    if callable(value) and hasattr(value, "__qualname__"):  # of a library, written in C or dispatched
        return {"type": f"{value.__module__}.{value.__qualname__}"}
    if type(value).__str__ is not object.__str__:
        return {"type": _public_name(type(value)), "source": str(value)}
    return {"type": _public_name(type(value)), **{name: describe(part) for name, part in parts(value).items()}}


def parts(value: Any) -> dict[str, Any]:
    """What an object was constructed from: a dataclass, or one whose arguments are attributes of the same names."""
    if dataclasses.is_dataclass(value) and (fields := dataclasses.fields(value)):
        names = [field.name for field in fields if field.init]
    else:
        names = [name for name in inspect.signature(type(value)).parameters if hasattr(value, name)]
    return {name: getattr(value, name) for name in names}


def rebuild(data: Any) -> Any:
    """The object that :func:`describe` described; lists come back as tuples.

    Raises
    ------
    ForeignTypeError
        It holds a type that is not socasadi's own: only the study's script can make that.
    """
    if isinstance(data, list):
        return tuple(rebuild(item) for item in data)
    if not isinstance(data, dict):
        return data
    fields = {name: rebuild(item) for name, item in data.items() if name != "type"}
    if "type" not in data:
        return fields
    module, _, name = data["type"].rpartition(".")
    if module.split(".")[0] != "socasadi":
        raise ForeignTypeError(f"{data['type']} can only be made by the study script that defines it")
    return getattr(importlib.import_module(module), name)(**fields)


def differences(old: Any, new: Any, path: str = "") -> list[str]:
    """Where two descriptions differ, one line each."""
    if isinstance(old, dict) and isinstance(new, dict):
        lines = []
        for name in [*old, *(name for name in new if name not in old)]:
            inner = f"{path}.{name}" if path else name
            lines += differences(old.get(name), new.get(name), inner)
        return lines
    return [] if old == new else [f"{path} was {old} and is {new}"]


def _body(function: FunctionType) -> dict[str, Any]:
    """What a function does: a digest of its code, its defaults, and the values and functions around it that it uses."""
    variables = inspect.getclosurevars(function)
    uses = {**variables.globals, **variables.nonlocals, **(function.__kwdefaults__ or {})}
    uses |= {f"default {i}": value for i, value in enumerate(function.__defaults__ or ())}
    # What calls itself is described once, and a module by its name alone.
    told = {name: describe(value) for name, value in uses.items() if value is not function and not _is_module(value)}
    return {"code": hashlib.sha256(_code(function.__code__).encode()).hexdigest()[:16], "uses": told}


def _is_module(value: Any) -> bool:
    return isinstance(value, ModuleType)


def _code(code: CodeType) -> str:
    constants = [_constant(item) for item in code.co_consts]
    return f"{code.co_code.hex()} {constants} {code.co_names}"


def _constant(item: Any) -> str:
    if isinstance(item, CodeType):
        return _code(item)
    # The order of a set is another in each process.
    return repr(sorted(map(repr, item))) if isinstance(item, frozenset) else repr(item)


def _public_name(kind: type | Callable[..., Any]) -> str:
    """Where a user would import a type or a function from: the first package above its private module."""
    # A study script is a module without a name of its own, whether Python or the command runs it.
    parts = [part for part in kind.__module__.split(".") if not part.startswith("_")] or ["script"]
    return ".".join([*parts, kind.__qualname__])
