"""What tells a method of one's own from itself before an edit."""

import functools
import hashlib
import inspect
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from ...campaign.store import code_names, code_text, parts, used_values

_PACKAGE = Path(__file__).parents[2]
_NOT_OWN = tuple(
    str(folder) for folder in (_PACKAGE, *(sysconfig.get_path(kind) for kind in ("stdlib", "purelib", "platlib")))
)

_Told = Iterator[tuple[str, str]]


def own_code(value: Any) -> str | None:
    """A digest of the code behind an object as far as it stands in files of one's own; None where none does.

    That of its class and of those of its parts, and of all functions and classes that they name, in modules of one's
    own as well; with the values that stand beside them there. What it was constructed from is not told, if its class is
    not one's own.
    """
    told = dict(_tell(value, "", set()))
    return hashlib.sha256(repr(sorted(told.items())).encode()).hexdigest()[:16] if told else None


def _tell(value: Any, name: str, seen: set[int]) -> _Told:
    """Texts by name of what there is of one's own in or behind a value; a plain value only if it goes by a name."""
    match value:
        case None | bool() | int() | float() | complex() | str() | bytes() | np.generic() | np.ndarray():
            if name:
                yield name, repr(value.tolist() if isinstance(value, np.ndarray) else value)
        case list() | tuple() | set() | frozenset():
            for i, item in enumerate(value if isinstance(value, list | tuple) else sorted(value, key=repr)):
                yield from _tell(item, name and f"{name}[{i}]", seen)
        case Mapping():
            for key, item in value.items():
                yield from _tell(item, name and f"{name}[{key!r}]", seen)
        case functools.partial():
            yield from _tell((value.func, value.args, value.keywords), name, seen)
        case MethodType():
            yield from _tell((value.__func__, value.__self__), name, seen)
        case _ if id(value) in seen or isinstance(value, ModuleType):
            return
        case _:
            seen.add(id(value))
            function = inspect.unwrap(value) if callable(value) else value
            if isinstance(function, FunctionType):
                yield from _of_function(function, seen)
            elif isinstance(value, type):
                yield from _of_class(value, seen)
            else:
                yield from _of_object(value, name, seen)


def _of_function(function: FunctionType, seen: set[int]) -> _Told:
    code, name = function.__code__, f"{function.__module__}.{function.__qualname__}"
    if code.co_filename.startswith((*_NOT_OWN, "<")):
        return
    yield name, code_text(code)
    for key, value in used_values(function).items():
        yield from _tell(value, f"{name}, {key}", seen)
        if isinstance(value, ModuleType) and _is_own(value.__name__):
            for inner in sorted(code_names(code) & vars(value).keys()):
                yield from _tell(vars(value)[inner], f"{name}, {key}.{inner}", seen)


def _of_class(kind: type, seen: set[int]) -> _Told:
    for base in kind.__mro__:
        if not _is_own(base.__module__):
            continue
        for key, member in vars(base).items():
            match member:
                case property():
                    member = member.fget
                case functools.cached_property():
                    member = member.func
                case classmethod() | staticmethod():
                    member = member.__func__
            if isinstance(member, FunctionType) or not key.startswith(("__", "_abc_")):
                yield from _tell(member, f"{base.__module__}.{base.__qualname__}.{key}", seen)


def _of_object(value: Any, name: str, seen: set[int]) -> _Told:
    kind = type(value)
    yield from _tell(kind, "", seen)
    if not (own := _is_own(kind.__module__)) and kind.__str__ is not object.__str__:  # an expression, a path
        if name and " at 0x" not in str(value):
            yield name, str(value)
        return
    try:
        within = parts(value)
        if own:  # a constructor of one's own may take what no field holds
            name = name or kind.__qualname__
            within |= {key: getattr(value, key) for key in inspect.signature(kind).parameters if hasattr(value, key)}
    except (TypeError, ValueError):  # a type written in C
        return
    for key, part in within.items():
        yield from _tell(part, name and f"{name}.{key}", seen)


def _is_own(module: str) -> bool:
    """Whether a module, by name, is a script or a file of one's own."""
    if module.partition(".")[0] in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(module), "__file__", None)
    return file is None or not file.startswith(_NOT_OWN)
