"""What the QP solver and a whole controller cost on a microcontroller: flash, RAM, stack, instructions.

    apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
    python studies/speed_microcontroller.py

On an emulated Cortex-M4F in float and a Cortex-M7 in double: the 200 tracking problems of studies/peers/qp.json, and
the default controller along a random episode whose reference keeps running into the bounds. Instructions are exact
and the same in every run; they are not cycles.
"""

import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
from peers.mpc_case import case
from peers.mpc_socasadi import LIBRARY, dual

from socasadi import LinearMPC, Modal
from socasadi.export import ControllerRecord, Core, Emulated, build, core_for, export, toolchain

PEERS = Path(__file__).parent / "peers"
THETA = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]


def main() -> None:
    if reason := toolchain():
        raise SystemExit(reason)
    print(f"{'instructions, median / worst':42} {'first 40 problems':>22} {'all':>22}")
    for checked in (False, True):
        for warm in (False, True):
            exact = tracking(core_for("double"), checked=checked, warm=warm)
            tracking(core_for("float"), checked=checked, warm=warm, exact=exact)
    print()
    for real in ("float", "double"):
        controller(core_for(real))


def tracking(core: Core, *, checked: bool, warm: bool, exact: np.ndarray | None = None) -> np.ndarray:
    """The tracking problems by qp_solve, from parameters to the first input, which is returned."""
    program = case(soft=True).program
    number = "float" if core.real == "float" else "double"
    tables = dual(program).replace("double", number)
    if core.real == "float":
        tables = re.sub(r"(?<=[{,\s])(-?\d[\d.]*(?:e[-+]?\d+)?)(?=[,}\s])", r"\1f", tables)
    with TemporaryDirectory() as folder:
        for file in ("real.h", "qp.h", "qp.c", "qp_residual.c"):
            Path(folder, file).write_text((LIBRARY / file).read_text())
        for file, source in (("tracking.h", "mpc_firmware.h"), ("tracking.c", "mpc_firmware.c")):
            Path(folder, file).write_text((PEERS / source).read_text())
        Path(folder, "tables.h").write_text(tables)
        parameters = program.p.shape[1]
        sizes = {"ROWS": len(program.rows), "PARAMETERS": parameters, "FIRST_INPUTS": program.first}
        Path(folder, "sizes.h").write_text("".join(f"#define {name} {size}\n" for name, size in sizes.items()))
        flags = (*core.flags, *(["-DREAL_FLOAT"] if core.real == "float" else []), *(["-DCHECKED"] if checked else []))
        firmware = build(folder, replace(core, flags=flags), name="tracking")
        wires: Any = SimpleNamespace(outputs=parameters, inputs=program.first)
        with Emulated(firmware, wires) as solver:
            answers = []
            for p in program.p:
                if not warm:
                    solver.reset()
                answers.append(solver.step(p, np.zeros(parameters)))
        counts = np.array([sample.instructions for sample in solver.samples])
        failed = sum(sample.status != 0 for sample in solver.samples)
    name = f"{core.name}, {core.real}, QP {'with KKT check' if checked else 'alone'}, {'warm' if warm else 'cold'}"
    columns = [f"{np.median(part):,.0f} / {part.max():,}" for part in (counts[:40], counts)]
    off = "" if exact is None else f", at most {np.abs(np.array(answers) - exact).max():.1e} u_max from double"
    print(f"{name:42} {columns[0]:>22} {columns[1]:>22}   {failed} failed{off}")
    return np.array(answers)


def controller(core: Core) -> None:
    """The default controller, whole steps."""
    mpc, random = LinearMPC(Modal()), np.random.default_rng(0)
    angle = 0.1 * (np.arange(400)[:, None] + np.arange(1, mpc.reference_rows + 1))
    record = ControllerRecord(
        mpc=mpc,
        system=mpc.model.state_space(THETA, mpc.sample_time),
        output=0.07 * np.cumsum(random.standard_normal((400, 2)), axis=0) / 20,
        preview=0.12 * np.stack([np.cos(angle), np.sin(2 * angle)], axis=-1),
        held=np.zeros(3),
    )
    with TemporaryDirectory() as folder:
        export(record, folder, real=core.real, figures=False)
        here = mpc.controller_for(record.system, real=core.real)  # pyright: ignore[reportArgumentType]
        difference = 0.0
        with Emulated(build(folder, core), mpc) as there:
            for sample in record.samples():
                difference = max(difference, float(np.abs(there.step(*sample) - here.step(*sample)).max()))
            print(
                f"{core.name}, {core.real}, default controller: {there.footprint}; {difference:g} N from the host's C"
            )


if __name__ == "__main__":
    main()
