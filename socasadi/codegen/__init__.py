"""A CasADi Function to C and to a shared library, cached by content; without a compiler, the Function itself."""

from ._buffered import Buffered
from ._cache import cache_directory
from ._compile import CompilationError, c_compiler, compiled, shared_library, warn_interpreted

__all__ = [
    "Buffered",
    "CompilationError",
    "c_compiler",
    "cache_directory",
    "compiled",
    "shared_library",
    "warn_interpreted",
]
