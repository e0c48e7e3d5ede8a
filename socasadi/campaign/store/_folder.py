"""The run folder: which file is which, and the settings in study.json."""

import importlib.metadata
import json
import os
import platform
from pathlib import Path
from typing import Any

from ._settings import differences

_PACKAGES = ("socasadi", "casadi", "numpy", "scipy", "GPy")


class RunError(RuntimeError):
    """A run folder, or a campaign in it, that cannot be used as asked."""


def journal_path(folder: Path) -> Path:
    """Where a run folder keeps its journal."""
    return folder / "journal.sqlite"


def settings_path(folder: Path) -> Path:
    """Where a run folder keeps every setting of its study."""
    return folder / "study.json"


def read_settings(folder: Path) -> dict[str, Any]:
    """Settings of the study that ``folder`` holds; RunError when it holds none."""
    path = settings_path(folder)
    try:
        settings = json.loads(path.read_text())["settings"]
        if not isinstance(settings, dict):
            raise TypeError(f"its settings are {settings!r}")
    except FileNotFoundError:
        raise RunError(f"{folder} is no run folder: it has no study.json") from None
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path} is damaged ({error!r}); restore it from a copy") from error
    return settings


def write_settings(folder: Path, settings: dict[str, Any]) -> None:
    """Store ``settings`` with the versions of what they were run with, whole or not at all."""
    about = {
        "settings": settings,
        "versions": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "python": platform.python_version(),
        "machine": platform.machine(),
    }
    scratch = folder / "study.json.new"
    scratch.write_text(json.dumps(about, indent=2) + "\n")
    settle(scratch, settings_path(folder))


def compare_settings(folder: Path, settings: dict[str, Any], may_differ: tuple[str, ...] = ()) -> None:
    """RunError, naming what changed, when ``folder`` holds other settings; ``may_differ`` are names at the top."""
    changed = [line for line in differences(read_settings(folder), settings) if line.split(" ")[0] not in may_differ]
    if changed:
        raise RunError(f"{folder} holds a run with other settings: {'; '.join(changed)}")


def begun(folder: Path) -> bool:
    """Whether ``folder`` holds anything but what a start that was killed left behind."""
    left = {"lock", "study.json.new"}
    left |= {f"journal.sqlite{new}{end}" for new in ("", ".new") for end in ("", "-wal", "-shm", "-journal")}
    return folder.is_dir() and not {file.name for file in folder.iterdir()} <= left


def settle(scratch: Path, path: Path) -> None:
    """Put ``scratch`` in the place of ``path``, and on the disk."""
    with scratch.open("rb") as file:
        os.fsync(file.fileno())
    scratch.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
