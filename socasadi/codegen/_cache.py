import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import platformdirs


def cache_directory() -> Path:
    """Folder that holds compiled functions: ``$SOCASADI_CACHE``, else the user's cache folder; created on demand."""
    folder = Path(os.environ.get("SOCASADI_CACHE") or platformdirs.user_cache_path("socasadi"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error
    return folder


def cached_file(name: str, build: Callable[[Path], None]) -> Path:
    """Path of ``name`` in the cache, made by ``build(folder) -> folder/name`` if it is not there.

    The file is built in a scratch folder and moved into place in one step, so that concurrent processes see
    either no file or a whole one; when two build the same name, the last move wins and both files are equal.
    """
    target = cache_directory() / name
    if not target.exists():
        try:
            scratch = tempfile.TemporaryDirectory(dir=target.parent, prefix=".building-")
        except OSError as error:
            raise _unwritable(target.parent, error) from error
        with scratch as folder:
            build(Path(folder))
            os.replace(Path(folder) / name, target)
    return target


def _unwritable(folder: Path, error: OSError) -> OSError:
    return OSError(
        f"the cache folder {folder} cannot be written to ({error.strerror}); set SOCASADI_CACHE to a writable folder"
    )
