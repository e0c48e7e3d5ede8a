"""What tells a function from itself before an edit."""

import inspect
from types import CodeType, FunctionType
from typing import Any


def code_text(code: CodeType) -> str:
    """What a piece of code does, whatever its place in a file."""
    constants = [_constant(item) for item in code.co_consts]
    return f"{code.co_code.hex()} {constants} {code.co_names}"


def code_names(code: CodeType) -> set[str]:
    """Names of globals and attributes in a piece of code and in the functions and classes within it."""
    inner = (item for item in code.co_consts if isinstance(item, CodeType))
    return {*code.co_names}.union(*map(code_names, inner))


def used_values(function: FunctionType) -> dict[str, Any]:
    """Values around a function that it, or a function within it, uses: globals, those of its closure, its defaults."""
    uses = {name: function.__globals__[name] for name in code_names(function.__code__) if name in function.__globals__}
    uses |= inspect.getclosurevars(function).nonlocals
    uses |= {f"default {i}": value for i, value in enumerate(function.__defaults__ or ())}
    return {name: uses[name] for name in sorted(uses)} | (function.__kwdefaults__ or {})


def _constant(item: Any) -> str:
    if isinstance(item, CodeType):
        return code_text(item)
    # The order of a set is another in each process.
    return repr(sorted(map(repr, item))) if isinstance(item, frozenset) else repr(item)
