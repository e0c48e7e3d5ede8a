"""What an exported controller asks of a machine: of this one, and of an emulated microcontroller."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..codegen import c_compiler
from ._errors import ExportError
from ._record import ControllerRecord
from .microcontroller import CORTEX_M4, CORTEX_M7, Core, Emulated, EmulatorError, build, toolchain

RANDOM_SAMPLES = 200
"""How many random samples the emulated microcontroller meets after the episode, in which no bound may be active."""


@dataclass(frozen=True)
class Figures:
    """Bytes and time of one controller on one machine, as texts for a table; "?" where they could not be found."""

    machine: str
    flash: str
    ram: str
    stack: str
    step: str


def core_for(real: str) -> Core:
    """The microcontroller whose floating-point unit computes in ``real``."""
    return CORTEX_M4 if real == "float" else CORTEX_M7


def host_figures(folder: Path, name: str, sources: Sequence[str], include_folders: Sequence[str]) -> Figures | None:
    """Figures of this machine, from a build beside the folder; None without a C compiler.

    Raises
    ------
    ExportError
        The controller does not compile.
    """
    compiler = c_compiler()
    if compiler is None:
        return None
    folder = folder.resolve()
    flags = ["-std=c99", "-O2", f"-I{folder}", *(f"-I{folder / include}" for include in include_folders)]
    with tempfile.TemporaryDirectory() as scratch:

        def run(*command: str) -> str:
            done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, stdin=subprocess.DEVNULL)
            if done.returncode:
                raise ExportError(f"{' '.join(command)} failed:\n{(done.stderr + done.stdout).strip()[-2000:]}")
            return done.stdout

        objects = [source.replace("/", "-").replace(".c", ".o") for source in sources]
        for source, made in zip(sources, objects, strict=True):
            run(*compiler, *flags, "-w", "-fstack-usage", "-c", str(folder / source), "-o", made)
        instance = Path(scratch, "instance.c")
        instance.write_text(f'#include "{name}.h"\n{name} instance;\n')
        run(*compiler, *flags, "-c", instance.name, "-o", "instance.o")
        run(*compiler, *flags, str(folder / "replay.c"), *objects, "-o", "replay", "-lm")
        code, ram = (_size(Path(scratch), files) for files in (objects, [*objects, "instance.o"]))
        timing = re.search(r"([\d.]+) us a step", run("./replay"))
        frames = [_frames(usage) for usage in Path(scratch).glob("*.su")]
        version = run(*compiler, "--version").splitlines()[0]
    return Figures(
        machine=f"this machine, {version}, -O2",
        flash=_bytes(code and code[0]),
        ram=_bytes(ram and ram[1]),
        stack=f"at most {sum(frames)} bytes" if frames else "?",
        step=f"{timing[1]} us on average over the episode" if timing else "?",
    )


def emulated_figures(folder: Path, name: str, record: ControllerRecord, core: Core) -> Figures | None:
    """Figures of a microcontroller that replays the recorded episode in the emulator; None without the tools."""
    if toolchain() is not None:
        return None
    machine = f"{core.name}, emulated, gcc -O2"
    try:
        with Emulated(build(folder, core, name=name), record.mpc) as controller:
            controller.reset(record.held)
            for sample in record.samples():
                controller.step(*sample)
            episode = controller.footprint
            controller.run_random(record.random_samples(RANDOM_SAMPLES))
            worst = controller.footprint
    except EmulatorError as error:
        return Figures(machine, "?", "?", "?", f"not measured: {error}")
    return Figures(
        machine=machine,
        flash=_bytes(worst.flash),
        ram=_bytes(worst.ram),
        stack=f"{worst.stack} bytes",
        step=f"{episode.instructions_median:,} instructions in the median of the episode, {worst.instructions_worst:,} "
        f"at worst ({worst.iterations_worst} iterations)",
    )


def _size(scratch: Path, objects: Sequence[str]) -> tuple[int, int] | None:
    """Bytes of flash (code, tables, initial values) and of RAM (initialised and not) of these object files."""
    if shutil.which("size") is None:
        return None
    said = subprocess.run(["size", *objects], cwd=scratch, capture_output=True, text=True).stdout
    rows = [list(map(int, line.split()[:3])) for line in said.splitlines()[1:]]
    return sum(text + data for text, data, _ in rows), sum(data + bss for _, data, bss in rows)


def _frames(usage: Path) -> int:
    """Sum of all stack frames of a file: without recursion no call needs more."""
    return sum(int(line.split("\t")[1]) for line in usage.read_text().splitlines())


def _bytes(count: int | None) -> str:
    return "?" if count is None else f"{count / 1000:.1f} kB"
