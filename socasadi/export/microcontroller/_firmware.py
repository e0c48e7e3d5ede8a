import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path

from .._errors import ExportError

PACKAGES = ("gcc-arm-none-eabi", "libnewlib-arm-none-eabi", "binutils-arm-none-eabi", "qemu-system-arm")
"""Debian packages that hold what the emulated microcontroller needs."""

STACK_SIZE = 65536
"""Bytes set apart for the stack in the emulator: more than a controller needs, for what it needs is measured."""

LONGEST_CALL = 100_000_000
"""Instructions after which a call of the controller is broken off: half a second and more of a fast microcontroller."""

_PREFIX = "arm-none-eabi-"
_FLAGS = ("-std=c99", "-ffp-contract=off", "-O2", "-ffunction-sections", "-fdata-sections")
_STRICT = ("-ffreestanding", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
_PROGRAMS = ("example.c", "replay.c")
_FIRMWARE = ("main", "startup", "semihosting")


class EmulatorError(ExportError):
    """The emulated microcontroller cannot be built or started, or the controller on it broke off."""


@dataclass(frozen=True)
class Core:
    """A processor that QEMU emulates, and how to compile for it.

    Attributes
    ----------
    name
        Arm's name.
    machine
        QEMU's board; the firmware knows mps2-an386 and mps2-an500.
    real
        ``"float"`` or ``"double"``: what its floating-point unit computes in. A controller of the other type runs, too:
        doubles on a Cortex-M4 by subroutines.
    flags
        Compiler flags. None of them may allow contracted products if doubles are to equal the host's.
    """

    name: str
    machine: str
    real: str
    flags: tuple[str, ...]


CORTEX_M4 = Core(
    "cortex-m4", "mps2-an386", "float", ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
)
"""Cortex-M4F: a floating-point unit for single precision."""

CORTEX_M7 = Core(
    "cortex-m7", "mps2-an500", "double", ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
)
"""Cortex-M7 with a floating-point unit for double precision."""


def toolchain() -> str | None:
    """None when the cross compiler and the emulator are there, else a sentence that says what is missing."""
    tools = [f"{_PREFIX}gcc", f"{_PREFIX}size", f"{_PREFIX}addr2line", "qemu-system-arm"]
    missing = [tool for tool in tools if shutil.which(tool) is None]
    # gcc answers with a path for files that it has, and with the bare name otherwise
    if not missing and "/" not in _run([tools[0], "-print-file-name=nano.specs"]).stdout:
        missing = ["newlib for it"]
    if not missing:
        return None
    return f"{', '.join(missing)} not found: on Debian, apt-get install {' '.join(PACKAGES)}"


@dataclass(frozen=True)
class Firmware:
    """An exported controller, linked for a core together with what serves it in the emulator.

    Attributes
    ----------
    image
        The ELF file.
    core, name
        What it was built for and from.
    flash, ram
        Bytes that the controller adds to an image: code, tables and initial values; its instance and other static
        variables. The C library's functions that it calls are counted, the firmware around it and the stack are not.
    image_flash, image_ram
        Bytes of the whole image, without the stack.
    """

    image: Path
    core: Core
    name: str
    flash: int
    ram: int
    image_flash: int
    image_ram: int
    scratch: tempfile.TemporaryDirectory[str] | None = field(default=None, repr=False, compare=False)
    """Keeps a temporary folder for as long as it is needed."""

    def function_at(self, address: int) -> str:
        """Name of the function that an instruction belongs to, ``"??"`` outside of all."""
        said = _run([f"{_PREFIX}addr2line", "-f", "-e", str(self.image), f"{address:#x}"]).stdout
        return said.splitlines()[0] if said else "??"


def build(folder: str | Path, core: Core, *, name: str = "controller", into: str | Path | None = None) -> Firmware:
    """Cross-compile an exported folder, which is only read, for the emulator.

    Parameters
    ----------
    folder
        Its ``.c`` files but for ``example.c`` and ``replay.c``, and those of ``osqp/`` when it is there, are the
        controller.
    name
        The controller's: the prefix of its functions, and in capitals of its sizes.
    into
        Folder for objects and image; made when it is not there. A temporary one by default, which is removed with the
        Firmware.

    Raises
    ------
    EmulatorError
        A tool is missing, ``folder`` holds no such controller, or something does not compile or link.
    """
    if reason := toolchain():
        raise EmulatorError(reason)
    exported = Path(folder).resolve()
    if not (exported / f"{name}.h").is_file():
        raise EmulatorError(f"{folder} holds no exported controller: there is no {name}.h in it")
    scratch = tempfile.TemporaryDirectory(prefix="socasadi-firmware-") if into is None else None
    target = Path(scratch.name if scratch else str(into)).resolve()
    target.mkdir(parents=True, exist_ok=True)
    with as_file(files("socasadi.export").joinpath("microcontroller", "c")) as own:
        objects = list(_compile(exported, own, core, name, target))
        image = target / f"{name}-{core.name}.elf"
        linker = f"-Wl,--gc-sections,--fatal-warnings,--defsym=stack_size={STACK_SIZE}"
        options = ["-nostartfiles", "--specs=nano.specs", linker, "-T", str(own / "link.ld")]
        _tool([*core.flags, *options, *objects, "-lm", "-o", image.name], target)
    sizes = _sections(image)
    loaded = [size for section, size in sizes.items() if not section.endswith(".bss") and section != ".stack"]
    memory = [size for section, size in sizes.items() if section.endswith((".data", ".bss"))]
    counted = {section: size for section, size in sizes.items() if section.startswith((".controller", ".library"))}
    return Firmware(
        image=image,
        core=core,
        name=name,
        flash=sum(size for section, size in counted.items() if not section.endswith(".bss")),
        ram=sum(size for section, size in counted.items() if section.endswith((".data", ".bss"))),
        image_flash=sum(loaded),
        image_ram=sum(memory),
        scratch=scratch,
    )


def _compile(exported: Path, own: Path, core: Core, name: str, target: Path) -> Iterator[str]:
    """Compile everything into objects in ``target``; their names, by which the linker script tells them apart."""
    osqp = exported / "osqp"
    headers = sorted({header.parent for header in osqp.rglob("*.h")})
    sources = [source for source in sorted(exported.glob("*.c")) if source.name not in _PROGRAMS]
    common = [*_FLAGS, *core.flags, *(f"-I{path}" for path in (exported, osqp, *headers))]
    for source in [*sources, *sorted(osqp.rglob("*.c"))]:
        made = "-".join(source.relative_to(exported).with_suffix(".o").parts)
        _tool([*common, "-c", str(source), "-o", made], target)
        yield made
    served = [*common, f"-I{own}", f'-DHEADER="{name}.h"', f"-DNAME={name}", f"-DCAPITALS={name.upper()}"]
    served.append(f"-DLONGEST_CALL={LONGEST_CALL}")
    for part in _FIRMWARE:
        made = f"firmware-{part}.o"
        _tool([*served, *_STRICT, "-c", str(own / f"{part}.c"), "-o", made], target)
        yield made
    _tool([*served, "-c", str(own / "instance.c"), "-o", "served-instance.o"], target)
    yield "served-instance.o"


def _tool(arguments: Sequence[str], folder: Path) -> None:
    run = _run([f"{_PREFIX}gcc", *arguments], folder)
    if run.returncode:
        raise EmulatorError(f"{_PREFIX}gcc {' '.join(arguments)} failed:\n{run.stderr.strip()[-2000:]}")


def _run(command: Sequence[str], folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)


def _sections(image: Path) -> dict[str, int]:
    """Bytes of the sections that the linker script names."""
    said = _run([f"{_PREFIX}size", "-A", "-d", str(image)]).stdout
    found = re.findall(r"^(\.(?:firmware|library|controller|ARM\.exidx|stack)\S*)\s+(\d+)", said, re.MULTILINE)
    return {section: int(size) for section, size in found}
