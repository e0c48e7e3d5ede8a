"""What tells a method of one's own from itself before an edit."""

import hashlib
import inspect
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import Any

_PACKAGE = Path(__file__).parents[2]
_NOT_OWN = tuple(
    str(folder) for folder in (_PACKAGE, *(sysconfig.get_path(kind) for kind in ("stdlib", "purelib", "platlib")))
)


def own_code(value: Any) -> str | None:
    """A digest of the code behind an object as far as it stands in files of one's own; None where none does.

    That of its class, of all functions and classes that this one names, and theirs, with plain values that they name.
    """
    found: dict[str, str] = {}
    _collect(value if inspect.isroutine(value) else type(value), found)
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()[:16] if found else None


def _collect(thing: Any, found: dict[str, str]) -> None:
    if inspect.isclass(thing):
        for base in thing.__mro__:
            for member in vars(base).values():
                inner = getattr(member, "fget", None) or getattr(member, "func", None) or member
                _collect(getattr(inner, "__func__", inner), found)
    elif inspect.isfunction(thing):
        code, name = thing.__code__, f"{thing.__module__}.{thing.__qualname__}"
        if name in found or code.co_filename.startswith(_NOT_OWN) or code.co_filename.startswith("<"):
            return
        found[name] = "".join(_told(code)) + repr((thing.__defaults__, thing.__kwdefaults__))
        used = inspect.getclosurevars(thing)
        for key, value in {**used.globals, **used.nonlocals}.items():
            if isinstance(value, bool | int | float | str | tuple):
                found[f"{name}, {key}"] = repr(value)
            else:
                _collect(value, found)


def _told(code: CodeType) -> Iterator[str]:
    yield f"{code.co_code.hex()} {code.co_names}"
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _told(constant)
        else:  # the order of a set is another in each process
            yield repr(sorted(map(repr, constant))) if isinstance(constant, frozenset) else repr(constant)
