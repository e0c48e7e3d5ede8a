import shutil
import tempfile
import warnings
from pathlib import Path
from typing import Any

from ..mpc import Design, Tables, tables
from ._accept import FLOAT_SHARE, check_single_precision, vectors
from ._figures import RANDOM_SAMPLES, Figures, core_for, emulated_figures, host_figures
from ._kind import Kind
from ._manifest import claim
from ._record import ControllerRecord
from ._sources import controller_facts, library
from ._template import environment
from .osqp import OsqpSources, write_osqp

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
    kind, folder = Kind(real, solver, name), Path(folder)
    if real == "float":
        check_single_precision(record)
    design = record.mpc.design(record.system)
    given = tables(record.mpc, design, real)  # pyright: ignore[reportArgumentType] (checked above)
    shared = library(kind)
    generated = [file.format(name) for file in _TEMPLATES.values()]
    with tempfile.TemporaryDirectory() as scratch:
        # Before anything of the folder is touched: the generator may be missing.
        osqp = _generated_by_osqp(design, scratch, real) if solver == "osqp" else None
        claim(folder, [*shared, *generated, "README.md", *(["osqp"] if osqp else [])])
        if osqp:
            shutil.copytree(Path(scratch) / "osqp", folder / "osqp")
    for file, text in shared.items():
        (folder / file).write_text(text)
    facts = {
        **_facts(record, kind, given),
        "sources": [*(f for f in shared if f.endswith(".c")), f"{name}.c", *(osqp.sources if osqp else ())],
        "include_folders": list(osqp.includes) if osqp else [],
    }
    templates = environment(real)
    for template, file in _TEMPLATES.items():
        (folder / file.format(name)).write_text(templates.get_template(template).render(facts))
    # First without figures, so that a failure to measure leaves an export behind.
    readme = templates.get_template("README.md")
    (folder / "README.md").write_text(readme.render(facts, figures=[]))
    if figures:
        (folder / "README.md").write_text(readme.render(facts, figures=_figures(folder, kind, record, facts)))
    return folder


def _generated_by_osqp(design: Design, folder: str, real: str) -> OsqpSources:
    dual = design.dual
    return write_osqp(design.hessian, design.rows / dual.unit[:, None], dual.softness, dual.price, folder, real=real)


def _figures(folder: Path, kind: Kind, record: ControllerRecord, facts: dict[str, Any]) -> list[Figures]:
    host = host_figures(folder, kind.name, facts["sources"], facts["include_folders"])
    there = emulated_figures(folder, kind.name, record, core_for(kind.real))
    return [figures for figures in (host, there) if figures]


def _facts(record: ControllerRecord, kind: Kind, given: Tables) -> dict[str, Any]:
    replayed = vectors(record, RANDOM_SAMPLES)
    if replayed.fallbacks > _MANY * len(replayed.input):
        warnings.warn(
            f"in {replayed.fallbacks} of {len(replayed.input)} samples the controller falls back from its QP's answer: "
            "it does not pass the check, for the weights lie too many decades apart",
            RuntimeWarning,
            stacklevel=4,
        )
    return {
        **controller_facts(record.mpc, kind, given, record.provenance),
        "episode": len(record.output),
        "replay_tolerance": _SHARE[kind.real],
        "scale": record.mpc.input_scale,
        **vars(replayed),
        "random_samples": RANDOM_SAMPLES,
    }
