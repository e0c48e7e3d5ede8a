import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

from ..codegen import c_compiler
from ._errors import ExportError, NotBuiltError


def build_and_replay(folder: str | Path) -> str:
    """Run ``make test`` in a copy of an exported folder and return what the replay printed.

    Raises
    ------
    NotBuiltError
        There is no C compiler or no make.
    ExportError
        The build or the comparison failed; with what was said.
    """
    compiler = c_compiler()
    if compiler is None or shutil.which("make") is None:
        missing = "C compiler" if compiler is None else "make"
        raise NotBuiltError(
            f"the exported controller was not built: no {missing} found; run 'make test' in {folder} where there is one"
        )
    with tempfile.TemporaryDirectory() as scratch:
        # Objects of this machine have no place in what is taken to another.
        copy = shutil.copytree(folder, Path(scratch) / "controller")
        run = subprocess.run(
            ["make", "-s", f"CC={shlex.join(compiler)}", "test"],
            cwd=copy,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
    if run.returncode:
        raise ExportError(f"'make test' failed in {folder}:\n{(run.stderr + run.stdout).strip()[-2000:]}")
    return run.stdout.strip()
