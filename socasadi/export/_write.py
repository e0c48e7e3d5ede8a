import dataclasses
import importlib.metadata
import platform
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import casadi as ca
import jinja2
import numpy as np

from ..codegen import c_compiler
from ..mpc import control_law
from ._record import ControllerRecord

TOLERANCE = 1e-4
"""Largest difference between a tension of the exported C and Python's that the replay allows, N: OSQP stops
iterating at a residual, so that its answers are good to about 1e-6 of the input bound."""


_TEMPLATES = ("controller_data.h", "episode.h", "README.md")
_GENERATED = (*_TEMPLATES, "law.c", "law.h", "osqp")


class ExportError(RuntimeError):
    """A controller that cannot be exported as asked, or whose C does not agree with Python."""


class NotBuiltError(ExportError):
    """An exported controller that is written but not built, for want of a compiler or make."""


def export(record: ControllerRecord, folder: str | Path, *, real: str = "double", solver: str = "osqp") -> Path:
    """Write ``record`` as a folder of C: controller, data, QP solver, Makefile, and an episode to replay.

    Parameters
    ----------
    folder
        Made when it is not there; files of an earlier export in it are replaced.
    real, solver
        ``"double"`` and ``"osqp"``.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ExportError
        Another ``real`` or ``solver`` is asked for, or the folder holds files of others by the same names.
    """
    if real != "double":
        raise ExportError(f"real={real!r} cannot be exported yet: OSQP is used in double precision; use real='double'")
    if solver != "osqp":
        raise ExportError(f"solver={solver!r} cannot be exported yet; use solver='osqp'")
    folder = Path(folder)
    sources = list(files("socasadi.export").joinpath("c").iterdir())
    names = {*(source.name for source in sources), *_GENERATED}
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder} is a file; name a folder for the C files")
    if not (folder / "controller_data.h").exists() and (others := sorted(n for n in names if (folder / n).exists())):
        raise ExportError(
            f"{folder} has files of the same names that are not an export's ({', '.join(others)}); choose another"
        )
    (folder / "osqp").mkdir(parents=True, exist_ok=True)
    mpc = dataclasses.replace(record.mpc, backend="osqp")
    design = mpc.design(record.system)

    laws = ca.CodeGenerator("law.c", {"with_header": True})
    laws.add(control_law(mpc, design))
    laws.add(control_law(mpc, design, with_qp=False))
    laws.generate(f"{folder}/")
    for source in sources:
        (folder / source.name).write_text(source.read_text())
    _copy_osqp(folder / "osqp")

    facts = {
        "title": "Model predictive controller tuned by socasadi",
        "provenance": [*record.provenance, *_versions()],
        "sample_time": mpc.sample_time,
        "outputs": mpc.outputs,
        "inputs": mpc.inputs,
        "horizon": mpc.horizon,
        "order": len(design.A),
        "scale": mpc.input_scale,
        "rest": design.rest,
        "input_bounds": mpc.input_bounds,
        "samples": len(record.output),
        "tolerance": TOLERANCE,
        "held": record.held,
        "output": record.output,
        "preview": record.preview.reshape(len(record.output), -1),
        "tension": expected_tensions(record),
        "machine": f"{platform.system()} on {platform.machine()}",
        "stack": f"{8 * _working_numbers(folder / 'law.h') / 1024:.0f}",
    }
    for name in _TEMPLATES:
        (folder / name).write_text(_template(name).render(facts))
    return folder


def expected_tensions(record: ControllerRecord) -> np.ndarray:
    """What the interpreted controller answers to the recorded episode, (T, m) N."""
    controller = record.mpc.controller_for(record.system)
    controller.reset(record.held)
    return np.array([controller.step(y, rows) for y, rows in zip(record.output, record.preview, strict=True)])


def build_and_replay(folder: str | Path) -> str:
    """Run ``make test`` in an exported folder and return what the replay printed.

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
    run = subprocess.run(
        ["make", "-s", f"CC={shlex.join(compiler)}", "test"],
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    if run.returncode:
        raise ExportError(f"'make test' failed in {folder}:\n{(run.stderr + run.stdout).strip()[-2000:]}")
    return run.stdout.strip()


def _working_numbers(header: Path) -> int:
    """How many doubles the larger of the two laws needs to work with, from the header that CasADi generated."""
    return max(int(count) for count in re.findall(r"#define \w+_SZ_W (\d+)", header.read_text()))


def _copy_osqp(folder: Path) -> None:
    """Headers and static library of OSQP, as the casadi package holds them."""
    package = Path(ca.__file__).parent
    library, headers = package / "libosqpstatic.a", package / "include" / "osqp"
    if not library.exists() or not headers.is_dir():
        raise ExportError(f"this build of casadi has no static OSQP library in {package}; install casadi from PyPI")
    shutil.copy(library, folder)
    shutil.copytree(headers, folder / "include" / "osqp", dirs_exist_ok=True)


def _versions() -> list[str]:
    names = ("socasadi", "casadi")
    return ["made with " + ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)]


def _template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("socasadi.export"), keep_trailing_newline=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["c"] = _initialiser
    return environment.get_template(name)


def _initialiser(array: Sequence | np.ndarray) -> str:
    """A C initialiser that reads back as the very same doubles."""
    values = np.asarray(array, dtype=float)
    if values.ndim == 1:
        return "{" + ", ".join(repr(float(value)) for value in values) + "}"
    return "{\n    " + ",\n    ".join(_initialiser(row) for row in values) + "}"
