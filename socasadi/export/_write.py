import importlib.metadata
import re
import shutil
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from ..mpc import Design, Tables, check_real, controller_sources, tables
from ._accept import FLOAT_SHARE, check_single_precision, vectors
from ._errors import ExportError
from ._figures import RANDOM_SAMPLES, Figures, core_for, emulated_figures, host_figures
from ._record import ControllerRecord
from .osqp import OsqpSources, osqp_adapter, write_osqp

SOLVERS = ("active-set", "osqp")
"""QP solvers of an exported controller."""

# How far the replay may be from Python, as a share of the input bound.
_SHARE = {"double": 1e-6, "float": FLOAT_SHARE}

_TEMPLATES = {
    "NAME_data.h": "{}_data.h",
    "NAME.h": "{}.h",
    "NAME.c": "{}.c",
    **{same: same for same in ("vectors.h", "replay.c", "example.c", "Makefile", "CMakeLists.txt")},
}
_MANY = 0.02
"""Share of samples that fall back, beyond which an export warns."""

_MANIFEST = ".socasadi-export"
"""Lists what an export wrote into its folder, which the next one there replaces."""


_TAKEN = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
bool catch class delete explicit export false friend mutable namespace new operator private protected public template
this throw true try typename using virtual
mpc qp real self data vectors replay example u y r w main malloc free printf memset memcpy
"""
"""Names that mean something in C, in C++ or in the exported files."""


_FUNCTIONS = ("mpc_init", "mpc_reset", "mpc_step", "qp_init", "qp_reset", "qp_solve", "qp_residual")
"""What the controller's C defines for the linker."""


@dataclass(frozen=True)
class _Kind:
    """How a controller is written out."""

    real: str
    solver: str
    name: str

    def __post_init__(self) -> None:
        try:
            check_real(self.real)
        except ValueError as error:
            raise ExportError(str(error)) from None
        if self.solver not in SOLVERS:
            raise ExportError(f"unknown solver {self.solver!r}; there are {', '.join(SOLVERS)}")
        if not re.fullmatch(r"(?!mpc_|qp_|real_)[a-z][a-z0-9_]*", self.name) or self.name in _TAKEN.split():
            raise ExportError(
                f"the name {self.name!r} does not do for C: small letters, digits and _, no word of the language and "
                "none that the export's own files use, such as mpc or data"
            )


def export(
    record: ControllerRecord,
    folder: str | Path,
    *,
    real: str = "double",
    solver: str = "active-set",
    name: str = "controller",
    figures: bool = True,
) -> Path:
    """Write ``record`` as a folder of C: controller, data, QP solver, build files, example, and an episode to replay.

    Parameters
    ----------
    folder
        Made when it is not there; files of an earlier export in it are replaced.
    real
        What it computes in: ``"double"``, or ``"float"``, which is compared with double first.
    solver
        ``"active-set"``, the project's own, or ``"osqp"``, by OSQP's code generator (``pip install osqp``).
    name
        Prefix of all that the C defines for the linker: controllers of different names fit in one program, except that
        OSQP's own names have no prefix, so that only one may solve by it.
    figures
        Whether to build it, on this machine and, where the tools are installed, for an emulated microcontroller, for
        what its README says of size and speed.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ExportError
        ``real``, ``solver`` or ``name`` is none, single precision does not do, or the folder holds files of others by
        the same names.
    """
    kind, folder = _Kind(real, solver, name), Path(folder)
    if real == "float":
        check_single_precision(record)
    design = record.mpc.design(record.system)
    given = tables(record.mpc, design, real)  # pyright: ignore[reportArgumentType] (checked above)
    library = _library(kind)
    generated = [file.format(name) for file in _TEMPLATES.values()]
    with tempfile.TemporaryDirectory() as scratch:
        # Before anything of the folder is touched: the generator may be missing.
        osqp = _generated_by_osqp(design, scratch, real) if solver == "osqp" else None
        _claim(folder, [*library, *generated, "README.md", *(["osqp"] if osqp else [])])
        if osqp:
            shutil.copytree(Path(scratch) / "osqp", folder / "osqp")
    for file, text in library.items():
        (folder / file).write_text(text)
    facts = {
        **_facts(record, kind, given),
        "sources": [*(f for f in library if f.endswith(".c")), f"{name}.c", *(osqp.sources if osqp else ())],
        "include_folders": list(osqp.includes) if osqp else [],
        "osqp": osqp is not None,
    }
    environment = _environment(real)
    for template, file in _TEMPLATES.items():
        (folder / file.format(name)).write_text(environment.get_template(template).render(facts))
    # First without figures, so that a failure to measure leaves an export behind.
    readme = environment.get_template("README.md")
    (folder / "README.md").write_text(readme.render(facts, figures=[]))
    if figures:
        (folder / "README.md").write_text(readme.render(facts, figures=_figures(folder, kind, record, facts)))
    return folder


def _generated_by_osqp(design: Design, folder: str, real: str) -> OsqpSources:
    dual = design.dual
    return write_osqp(design.hessian, design.rows / dual.unit[:, None], dual.softness, dual.price, folder, real=real)


def _figures(folder: Path, kind: _Kind, record: ControllerRecord, facts: dict[str, Any]) -> list[Figures]:
    host = host_figures(folder, kind.name, facts["sources"], facts["include_folders"])
    there = emulated_figures(folder, kind.name, record, core_for(kind.real))
    return [figures for figures in (host, there) if figures]


def _library(kind: _Kind) -> dict[str, str]:
    """The C that is the same for every controller, by file name, with what sets this export apart in real.h."""
    sources = controller_sources()
    apart = [f"#define {function} {kind.name}_{function}" for function in _FUNCTIONS]
    if kind.real == "float":
        apart += ["#ifndef REAL_FLOAT", "#define REAL_FLOAT", "#endif"]
    before, after = sources["real.h"].split("#include <float.h>")
    told = "/* This export's number type, and names of its own, so that it links beside others. */"
    sources["real.h"] = "\n".join([f"{before}{told}", *apart, "", f"#include <float.h>{after}"])
    if kind.solver == "osqp":
        sources["qp.c"] = osqp_adapter()
    return sources


def _claim(folder: Path, names: list[str]) -> None:
    """Make the folder, or clear it of an earlier export, having seen that none of these names is somebody else's."""
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder} is a file; name a folder for the C files")
    manifest = folder / _MANIFEST
    # Names in the folder itself, whatever may have been written into the list.
    ours = {Path(name).name for name in manifest.read_text().splitlines()} if manifest.is_file() else set()
    if others := sorted(name for name in names if (folder / name).exists() and name not in ours):
        raise ExportError(
            f"{folder} has files of the same names that are not an export's ({', '.join(others)}); choose another"
        )
    for name in ours:
        if (folder / name).is_dir():
            shutil.rmtree(folder / name)
        else:
            (folder / name).unlink(missing_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    manifest.write_text("\n".join(names) + "\n")


def _facts(record: ControllerRecord, kind: _Kind, given: Tables) -> dict[str, Any]:
    mpc, replayed = record.mpc, vectors(record, RANDOM_SAMPLES)
    if replayed.fallbacks > _MANY * len(replayed.input):
        warnings.warn(
            f"in {replayed.fallbacks} of {len(replayed.input)} samples the controller falls back from its QP's answer: "
            "it does not pass the check, for the weights lie too many decades apart",
            RuntimeWarning,
            stacklevel=4,
        )
    program = {f"qp_{array}": values for array, values in given.program.arrays.items()}
    arrays = {array: values for array, values in given.arrays.items() if values.size}
    share = _SHARE[kind.real]
    return {
        "title": "Model predictive controller tuned by socasadi",
        "provenance": [*record.provenance, f"made by {', '.join(_versions(kind))}"],
        "name": kind.name,
        "NAME": kind.name.upper(),
        "real": kind.real,
        "solver": kind.solver,
        "sample_time": mpc.sample_time,
        "horizon": mpc.horizon,
        "input_bounds": mpc.input_bounds,
        "rate_bounds": mpc.rate_bounds,
        **given.sizes,
        **given.limits,
        "rows": given.program.rows,
        "iterations": given.program.iterations,
        "tables": list((arrays | program).items()),
        "arrays": list(arrays),
        "program": list(given.program.arrays),
        "table_numbers": sum(values.size for values in (arrays | program).values()),
        "episode": len(record.output),
        "replay_tolerance": share,
        "scale": mpc.input_scale,
        **vars(replayed),
        "random_samples": RANDOM_SAMPLES,
    }


def _versions(kind: _Kind) -> list[str]:
    packages = ["socasadi", "casadi", "numpy", *(["osqp"] if kind.solver == "osqp" else [])]
    return [f"{package} {importlib.metadata.version(package)}" for package in packages]


def _environment(real: str) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("socasadi.export"),
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=False,
    )
    suffix = "f" if real == "float" else ""

    def number(value: float) -> str:
        """A literal that reads back as the very same number."""
        text = str(np.float32(value)) if real == "float" else repr(float(value))
        return (text if any(sign in text for sign in ".en") else f"{text}.0") + suffix

    def initialiser(array: Sequence | np.ndarray) -> str:
        values = np.asarray(array, dtype=float)
        if values.ndim > 1:
            return "{\n    " + ",\n    ".join(initialiser(row) for row in values) + "}"
        lines = [", ".join(map(number, values[i : i + 8])) for i in range(0, len(values), 8)]
        return "{" + ",\n    ".join(lines) + "}"

    environment.filters |= {"c": initialiser, "number": number}
    return environment
