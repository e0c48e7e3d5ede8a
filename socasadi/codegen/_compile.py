import functools
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import warnings
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from ._cache import cached_file

_FLAGS = ("-O2", "-fPIC", "-shared")


class CompilationError(RuntimeError):
    """The C compiler was found but did not accept generated code; the message carries what it said."""


def c_compiler() -> list[str] | None:
    """Command of the C compiler: ``$CC``, which may hold arguments, else cc, gcc or clang; None when none is found."""
    chosen = os.environ.get("CC")
    for command in [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]:
        if command and (path := shutil.which(command[0])):
            return [path, *command[1:]]
    return None


def compiled(function: ca.Function, *, flags: Sequence[str] = ()) -> ca.Function:
    """The same Function as machine code.

    The C that CasADi generates for ``function`` is compiled, for this machine's own processor, to a shared library,
    which is kept in :func:`cache_directory` under a hash of the C text, the compiler, the processor and the flags: a
    second call, in this process or another, only loads it. Without a C compiler ``function`` itself is returned, and
    a warning says so once for the process.

    Parameters
    ----------
    function
        Any Function for which CasADi generates C.
    flags
        Further compiler and linker flags: include folders, definitions, libraries.

    Raises
    ------
    CompilationError
        The compiler rejected the code.
    """
    compiler = c_compiler()
    if compiler is None:
        _warn_interpreted()
        return function
    source = _c_source(function)
    native, target = _target(tuple(compiler))
    parts = (source, *compiler, target, *_FLAGS, *native, *flags)
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    name = f"{function.name()}-{digest}.so"

    def build(folder: Path) -> None:
        (folder / "function.c").write_text(source)
        command = [*compiler, *_FLAGS, *native, "function.c", "-o", name, *flags, "-lm"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if run.returncode:
            raise CompilationError(
                f"{' '.join(command)} failed on the C of {function.name()!r}:\n{run.stderr.strip()[:2000]}"
            )

    library = cached_file(name, build)
    try:
        return ca.external(function.name(), str(library))
    except RuntimeError:  # a damaged file: cut off by a full disk, say
        library.unlink(missing_ok=True)
        return ca.external(function.name(), str(cached_file(name, build)))


def _c_source(function: ca.Function) -> str:
    generator = ca.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    return generator.dump()


@functools.cache
def _target(compiler: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """Flags that let the compiler use all of this processor, and a text that tells both from others.

    The macros that a compiler defines for ``-march=native`` name its version and each extension of the processor.
    """
    for flags in (("-march=native",), ()):
        run = subprocess.run([*compiler, *flags, "-dM", "-E", "-x", "c", os.devnull], capture_output=True, text=True)
        if run.returncode == 0:
            return flags, run.stdout
    return (), platform.platform()


def _advice() -> str:
    chosen = os.environ.get("CC")
    return f"CC names {chosen!r}, which is not there" if chosen else "set CC, or install gcc"


@functools.cache
def _warn_interpreted() -> None:
    warnings.warn(
        f"no C compiler found ({_advice()}): models run interpreted, more slowly but with the same results",
        RuntimeWarning,
        stacklevel=3,
    )
