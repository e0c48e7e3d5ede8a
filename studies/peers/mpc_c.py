"""Solvers in C: compiled with mpc_time.c alike, each a process that waits for the next round."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .mpc_case import Program

HERE = Path(__file__).parent
FLAGS = ("-O3", "-march=native")


class InC:
    """A solver that implements mpc_time.h: `round` solves its problems once, one after the other."""

    def __init__(self, folder: Path, program: Program, executable: Path, warm: bool) -> None:
        self.count, self.inputs = len(program.p), program.inputs
        problems = folder / "problems"
        np.ascontiguousarray(program.p, dtype=float).tofile(problems)
        numbers = [str(n) for n in (self.count, program.p.shape[1], self.inputs, int(warm))]
        self.process = subprocess.Popen(
            [executable, problems, *numbers], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )

    def round(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Seconds (count,), iterations (count,; -1: failed) and answers (count, inputs x horizon) of one round."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(b".")
        self.process.stdin.flush()
        wanted = 8 * self.count * (2 + self.inputs)
        data = self.process.stdout.read(wanted)
        if len(data) < wanted:
            raise RuntimeError(f"the solver's process ended with {self.process.wait()}")
        numbers = np.frombuffer(data)
        seconds, iterations, z = np.split(numbers, [self.count, 2 * self.count])
        return seconds, iterations, z.reshape(self.count, self.inputs)

    def close(self) -> None:
        """End the process."""
        self.process.communicate()


def build(
    folder: Path,
    program: Program,
    sources: Sequence[str | Path],
    *,
    include: Sequence[str | Path] = (),
    link: Sequence[str | Path] = (),
    define: Sequence[str] = (),
    tables: str = "",
) -> Path:
    """An executable of these sources, mpc_time.c and the problem's tables, in `folder`."""
    if shutil.which("gcc") is None:
        raise FileNotFoundError("gcc is not installed")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "problem.h").write_text(header(program) + tables)
    executable = folder / "time"
    paths = [f"-I{path}" for path in (folder, HERE, *include)]
    files = [HERE / source for source in sources]
    flags = [*FLAGS, *(f"-D{name}" for name in define)]
    command = ["gcc", *flags, *paths, "-o", executable, HERE / "mpc_time.c", *files, *link, "-lm"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"gcc: {done.stderr[:300]}")
    return executable


def header(program: Program) -> str:
    """The problem's tables as a header."""
    sizes = {
        "INPUTS": program.inputs,
        "FIRST_INPUTS": program.first,
        "PARAMETERS": program.p.shape[1],
        "ROWS": len(program.rows),
        "OUTPUT_ROWS": len(program.response),
        "SOFTENING": repr(float(program.softening)),
        "COST": repr(program.cost),
    }
    tables = {
        "hessian": program.hessian,
        "gradient": program.gradient.T,
        "response": program.response,
        "row_free": program.row_free.T,
        "row_map": row_map(program).T,
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    return "\n".join([*lines, *(table(name, values) for name, values in tables.items())]) + "\n"


def row_map(program: Program) -> np.ndarray:
    """The bounded rows where the bounds do not bind, by the parameters: (rows, parameters)."""
    return program.row_free - program.rows @ np.linalg.solve(program.hessian, program.gradient)


def table(name: str, values: Any, kind: str = "double") -> str:
    """A C array."""
    values = np.asarray(values)
    values = values if values.size else np.zeros(1)
    sizes = "".join(f"[{n}]" for n in values.shape)
    numbers = ",".join(repr(value) for value in values.ravel().tolist())
    return f"static const {kind} {name}{sizes} __attribute__((unused, aligned(64))) = {{{numbers}}};"
