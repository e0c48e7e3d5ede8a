"""What tells a method of one's own from itself before an edit: the parts of one's own files that it is made of."""

import ast
import functools
import hashlib
import importlib.util
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

from ...campaign.store import parts

_PACKAGE = Path(__file__).parents[2]
_NOT_OWN = (
    *(str(folder) for folder in (_PACKAGE, *map(sysconfig.get_path, ("stdlib", "purelib", "platlib")))),
    "<",  # made by a program, or typed
)
_Statement = ast.stmt | ast.expr


def own_code(value: Any) -> str | None:
    """A digest of the source behind an object as far as it stands in files of one's own; None where none does.

    Of the file in which its class stands, or that of one of its parts, those statements that make what the class names,
    and what they name; and all of the files of one's own that they import. Comments and docstrings do not count.
    """
    told: set[str] = set()
    for thing in _made_of(value, {}):
        if (file := _file(thing)) is not None:
            told |= _slice(file, thing)
        elif thing.__module__ not in sys.modules:  # a script's, without a function of its own
            told |= {f"{thing.__qualname__}.{name} = {value!r}" for name, value in _plain(thing)}
    return hashlib.sha256(repr(sorted(told)).encode()).hexdigest()[:16] if told else None


def is_own(file: str) -> bool:
    """Whether a file is neither the package's nor a library's."""
    return not file.startswith(_NOT_OWN)


def _made_of(value: Any, seen: dict[int, Any]) -> Iterator[FunctionType | type]:
    """Functions and classes in an object and its parts."""
    if value is None or isinstance(value, bool | int | float | complex | str | bytes) or id(value) in seen:
        return
    seen[id(value)] = value  # kept, lest another takes its id
    inner: Any = ()
    match value:
        case list() | tuple() | set() | frozenset():
            inner = value
        case Mapping():
            inner = value.values()
        case functools.partial():
            inner = (value.func, value.args, value.keywords)
        case MethodType():
            inner = (value.__func__, value.__self__)
        case FunctionType():
            yield value
            inner = (getattr(value, "__wrapped__", None),)
        case type():
            yield from value.__mro__
        case _:
            try:
                inner = (type(value), parts(value))
            except (TypeError, ValueError):  # of a type written in C
                inner = (type(value),)
    for item in inner:
        yield from _made_of(item, seen)


def _plain(thing: FunctionType | type) -> Iterator[tuple[str, Any]]:
    for name, value in vars(thing).items():
        if not name.startswith("__") and isinstance(value, bool | int | float | complex | str | tuple | None):
            yield name, value


def _file(thing: FunctionType | type) -> Path | None:
    """The file of one's own in which a function, or the first method of a class, stands."""
    inner = [thing] if isinstance(thing, FunctionType) else [getattr(m, "fget", m) for m in vars(thing).values()]
    files = (function.__code__.co_filename for function in inner if isinstance(function, FunctionType))
    file = next((Path(name) for name in files if is_own(name)), None)
    return file if file is not None and file.is_file() else None


def _slice(file: Path, thing: FunctionType | type) -> set[str]:
    """What a function or a class is made of, statement by statement of its file, and all files that these import."""
    tree, told = _parsed(file.read_text(encoding="utf-8")), set()
    package = getattr(sys.modules.get(thing.__module__), "__package__", None) or ""
    names = {thing.__qualname__.partition(".")[0], "*"}
    todo: list[_Statement] = [statement for statement in tree.body if names & _touched(statement)]
    if isinstance(thing, FunctionType) and "<lambda>" in names:  # it may stand in the statement of the comparison
        line = thing.__code__.co_firstlineno
        todo += [node for node in ast.walk(tree) if isinstance(node, ast.Lambda) and node.lineno == line]
    files: dict[Path, str] = {}
    while todo:
        statement = todo.pop()
        told.add(ast.dump(statement))
        _add_imported(statement, package, files)
        more = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)} - names
        names |= more
        todo += [other for other in tree.body if more & _touched(other)]
    return told | set(files.values())


def _touched(statement: ast.stmt) -> set[str]:
    """Names that a statement makes, or changes what goes by them; "*" stands for all that a module has."""
    match statement:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return {name}
        case ast.Expr(value=ast.Call(func=called)):
            return _root(called)
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            return {(alias.asname or alias.name).partition(".")[0] for alias in aliases}
        case ast.Assign(targets=targets):
            return set().union(*(_root(part) for target in targets for part in ast.walk(target)))
        case ast.AugAssign(target=target) | ast.AnnAssign(target=target):
            return _root(target)
    inner = [node for node in ast.walk(statement) if isinstance(node, ast.stmt) and node is not statement]
    made = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return made.union(*map(_touched, inner))


def _root(target: ast.AST) -> set[str]:
    """The name at the root of ``name.part[key]``."""
    while isinstance(target, ast.Attribute | ast.Subscript):
        target = target.value
    return {target.id} if isinstance(target, ast.Name) else set()


def _add_imported(tree: ast.AST, package: str, files: dict[Path, str]) -> None:
    """Add the files of one's own that are imported in a tree, and what these import, with what they say."""
    for name in _imported(tree, package):
        file = _found(name)
        if file is not None and file not in files:
            inner = _parsed(file.read_text(encoding="utf-8"))
            files[file] = ast.dump(inner)
            _add_imported(inner, name if file.stem == "__init__" else name.rpartition(".")[0], files)


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            if node.level:
                module = importlib.util.resolve_name(module, package) if package else node.module or ""
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))


def _found(module: str) -> Path | None:
    """The file of one's own that a module is, if it is one."""
    if not module or module.partition(".")[0] in sys.stdlib_module_names:
        return None
    parent = module.rpartition(".")[0]
    if parent and _found(parent) is None:
        return None
    if (file := getattr(sys.modules.get(module), "__file__", None)) is None:
        try:
            spec = importlib.util.find_spec(module)
        except (ImportError, ValueError, AttributeError):
            return None
        file = spec.origin if spec else None
    own = file is not None and file.endswith(".py") and not file.startswith(_NOT_OWN)
    return Path(file) if own and file is not None else None


@functools.lru_cache(maxsize=64)
def _parsed(source: str) -> ast.Module:
    """A file's tree without docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            match node.body:
                case [ast.Expr(value=ast.Constant(value=str())), *_]:
                    del node.body[0]
    return tree
