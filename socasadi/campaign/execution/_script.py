"""A study from the Python file that defines it."""

import runpy
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..store import RunError

if TYPE_CHECKING:
    from .._study import Study


def load_study(script: str | Path) -> "Study":
    """The ``study`` that ``script`` defines.

    Raises
    ------
    RunError
        There is no such file, it is none of Python's, it breaks off (the message says where), or it defines no study.
    """
    from .._study import Study

    script = Path(script)
    if script.is_file() and script.suffix != ".py":
        raise RunError(f"{script} is no Python file (.py); name the one that defines the study")
    study = load_script(script).get("study")
    if not isinstance(study, Study):
        raise RunError(f"{script} defines no `study`: let it make one, study = Study(plant=..., mpc=..., task=...)")
    return study


def load_script(script: Path) -> dict[str, Any]:
    """All that a script defines; it is run as a module that is not the main one.

    Raises
    ------
    RunError
        There is no such file, or it breaks off; the message says where.
    """
    if script.is_dir():
        raise RunError(f"{script} is a folder; name the Python file that defines the study")
    if not script.is_file():
        raise RunError(f"there is no study script {script}")
    # As when Python runs it: the script may import what lies beside it.
    sys.path.insert(0, str(script.parent))
    try:
        return runpy.run_path(str(script), run_name="__study__")
    except SyntaxError as error:
        raise RunError(f"{error.filename}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(script)]
        place = f"{script}, line {lines[-1]}" if lines else str(script)
        raise RunError(f"{place}: {type(error).__name__}: {error}") from error
