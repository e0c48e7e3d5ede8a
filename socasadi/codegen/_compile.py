import functools
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca

from ._cache import cache_directory, cached_file

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

    The C that CasADi generates for ``function`` becomes a :func:`shared_library`, so that a second call, in this
    process or another, only loads it. Without a C compiler ``function`` itself is returned, and
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
    if c_compiler() is None:
        warn_interpreted()
        return function
    sources = {f"{function.name()}.c": _c_source(function)}
    try:
        return ca.external(function.name(), str(shared_library(function.name(), sources, flags=flags)))
    except RuntimeError:  # a damaged file: cut off by a full disk, say
        return ca.external(function.name(), str(shared_library(function.name(), sources, flags=flags, anew=True)))


def shared_library(name: str, sources: Mapping[str, str], *, flags: Sequence[str] = (), anew: bool = False) -> Path:
    """C texts compiled, for this machine's own processor, to a shared library, or the one from an earlier call.

    It is kept in :func:`cache_directory` under a hash of the texts, the compiler, the processor and the flags.

    Parameters
    ----------
    name
        How the file's name begins.
    sources
        Texts by file name; those that end in .c are compiled, and may include the others.
    flags
        Further compiler and linker flags: include folders, definitions, libraries.
    anew
        Whether to compile even if the library is there.

    Raises
    ------
    CompilationError
        There is no compiler, or it rejected the code.
    """
    compiler = c_compiler()
    if compiler is None:
        raise CompilationError(f"no C compiler found ({_advice()})")
    native, target = _target(tuple(compiler))
    parts = (*(text for item in sorted(sources.items()) for text in item), *compiler, target, *_FLAGS, *native, *flags)
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    file = f"{name}-{digest}.so"

    def build(folder: Path) -> None:
        for source, text in sources.items():
            (folder / source).write_text(text)
        units = [source for source in sources if source.endswith(".c")]
        command = [*compiler, *_FLAGS, *native, *units, "-o", file, *flags, "-lm"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if run.returncode:
            raise CompilationError(f"{' '.join(command)} failed on the C of {name!r}:\n{run.stderr.strip()[:2000]}")

    if anew:
        (cache_directory() / file).unlink(missing_ok=True)
    return cached_file(file, build)


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
def warn_interpreted() -> None:
    """Say once for the process that there is no C compiler."""
    warnings.warn(
        f"no C compiler found ({_advice()}): everything runs interpreted, more slowly but with the same results",
        RuntimeWarning,
        stacklevel=3,
    )
