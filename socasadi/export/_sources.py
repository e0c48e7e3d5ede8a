"""The parts of an export that no theta changes, and the one header that it does."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..model import StateSpace
from ..mpc import LinearMPC, Tables, controller_sources, tables
from ._kind import Kind
from ._manifest import claim
from ._template import data_facts, environment
from .osqp import osqp_adapter

_FUNCTIONS = ("mpc_init", "mpc_reset", "mpc_step", "qp_init", "qp_reset", "qp_solve", "qp_residual")
"""What the controller's C defines for the linker."""

_EXPERIMENT = {
    "NAME.h": "{}.h",
    "NAME.c": "{}.c",
    "NAME_task.h": "{}_task.h",
    **{same: same for same in ("experiment.c", "experiment.h")},
    "sources.md": "README.md",
}


def library(kind: Kind) -> dict[str, str]:
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


def controller_facts(mpc: LinearMPC, kind: Kind, given: Tables, provenance: Sequence[str]) -> dict[str, Any]:
    """What the templates of a controller take."""
    return {
        **data_facts(kind, given, provenance),
        "solver": kind.solver,
        "sample_time": mpc.sample_time,
        "horizon": mpc.horizon,
        "input_bounds": mpc.input_bounds,
        "rate_bounds": mpc.rate_bounds,
        **given.sizes,
        "rows": given.program.rows,
        "iterations": given.program.iterations,
        "program": list(given.program.arrays),
    }


def data_header(
    mpc: LinearMPC,
    system: StateSpace,
    *,
    real: str = "double",
    name: str = "controller",
    provenance: Sequence[str] = (),
) -> str:
    """Text of NAME_data.h, all numbers of one controller: the only file of an export that depends on its model.

    Beside the other files of an :func:`export` or of :func:`export_sources` with the same ``mpc``, ``real`` and
    ``name`` it makes the controller on ``system``. In single precision it is not compared with double, for which an
    episode is needed.

    Raises
    ------
    ExportError
        ``real`` or ``name`` is none.
    DesignError
        The model gives no controller.
    """
    kind = Kind(real, "active-set", name)
    given = tables(mpc, mpc.design(system), real)  # pyright: ignore[reportArgumentType] (checked above)
    facts = data_facts(kind, given, provenance)
    return environment(real).get_template("NAME_data.h").render(facts)


def export_sources(
    mpc: LinearMPC,
    system: StateSpace,
    reference: np.ndarray,
    folder: str | Path,
    *,
    real: str = "double",
    name: str = "controller",
    note: str = "",
) -> Path:
    """Write what flies experiments with a controller, without the numbers of any: they come as NAME_data.h.

    The C of the controller, the task as a table, and ``experiment.c``, which flies it on a robot that two functions of
    one's own bring (see ``experiment.h``) and prints the recording. Nothing is compiled without a
    :func:`data_header`: put it beside these files, or its folder on the compiler's path.

    Parameters
    ----------
    system
        Any prediction model of the family, of which sizes are taken only.
    reference
        (samples + 1 + mpc.reference_rows, p) what is wanted at t = 0, 1, ... samples.
    folder
        Made when it is not there; what an earlier call wrote there is replaced.
    note
        What else is to be known of the experiment, for its README.md.

    Raises
    ------
    ExportError
        As :func:`export`.
    ValueError
        The reference is shorter than one sample.
    """
    kind, folder = Kind(real, "active-set", name), Path(folder)
    samples = len(reference) - 1 - mpc.reference_rows
    if np.shape(reference)[1:] != (mpc.outputs,) or samples < 1:
        raise ValueError(
            f"the reference has shape {np.shape(reference)}, but ({mpc.reference_rows + 2} or more, {mpc.outputs}) "
            "is needed"
        )
    given = tables(mpc, mpc.design(system), real)  # pyright: ignore[reportArgumentType] (checked above)
    files = library(kind)
    facts = {
        **controller_facts(mpc, kind, given, ()),
        "samples": samples,
        "reference": reference,
        "note": note,
        "sources": [*(file for file in files if file.endswith(".c")), f"{name}.c"],
    }
    templates = environment(real)
    for template, file in _EXPERIMENT.items():
        files[file.format(name)] = templates.get_template(template).render(facts)
    claim(folder, list(files))
    for file, text in files.items():
        (folder / file).write_text(text)
    return folder
