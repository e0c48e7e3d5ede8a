import struct
from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...mpc import ControllerInfo
from ._firmware import EmulatorError, Firmware
from ._machine import Machine

if TYPE_CHECKING:
    from ...mpc import LinearMPC


_MOST_INSTRUCTIONS = 300_000_000
"""After as many random samples have been enough: a few seconds of emulation. (A count, so that all runs are alike.)"""

_COUNTS = ("status", "iterations", "steps", "clipped", "held", "refused", "worst_iterations")


@dataclass(frozen=True)
class Sample:
    """What one step in the emulator cost.

    Attributes
    ----------
    status, iterations
        As in the controller's info.
    instructions
        Executed from the call to the return, exactly (of every 5 million, 6 are those of the emulator's watch for calls
        that do not end). They are not cycles.
    stack
        Bytes below the caller's frame up to the last one that was written.
    """

    status: int
    iterations: int
    instructions: int
    stack: int


@dataclass(frozen=True)
class Footprint:
    """What a controller asks of a microcontroller.

    Attributes
    ----------
    flash, ram
        Bytes of the controller, as :class:`Firmware` counts them.
    stack
        Bytes, the most that any step used.
    instructions_median, instructions_worst, iterations_worst
        Of the steps.
    image_flash, image_ram
        Bytes of the whole image in the emulator, without the stack.
    """

    flash: int
    ram: int
    stack: int
    instructions_median: int
    instructions_worst: int
    iterations_worst: int
    image_flash: int
    image_ram: int

    def __str__(self) -> str:
        return (
            f"flash {self.flash / 1000:.1f} kB, RAM {self.ram / 1000:.1f} kB, stack {self.stack} bytes; "
            f"instructions a step: median {self.instructions_median:,}, worst {self.instructions_worst:,} "
            f"({self.iterations_worst} iterations)"
        )


class Emulated:
    """An exported controller at work in an emulated microcontroller, with a controller's ``reset`` and ``step``.

    A context manager: the emulator runs inside the ``with`` statement, and the controller starts as after ``reset()``.
    Numbers reach the controller rounded to its own number type and come back unchanged.

    Parameters
    ----------
    firmware
        What :func:`build` made.
    mpc
        The controller's specification.
    timeout
        s of wall time that one answer may take.

    Attributes
    ----------
    info
        Counts of samples and fallbacks since the last reset.
    samples
        Every step since the start.

    Raises
    ------
    EmulatorError
        The emulator does not start or does not count instructions as it should, or the controller is not the
        specification's. From ``reset`` and ``step``: the controller broke off (a processor's fault, no end in sight).
    """

    def __init__(self, firmware: Firmware, mpc: "LinearMPC", *, timeout: float = 60.0) -> None:
        self.firmware, self.mpc, self.timeout = firmware, mpc, timeout
        self.info = ControllerInfo()
        self.samples: list[Sample] = []
        self._machine: Machine | None = None

    def __enter__(self) -> "Emulated":
        self._machine = Machine(self.firmware, self.timeout)
        try:
            self._greet(self._machine)
        except BaseException:
            self._machine.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._machine:
            self._machine.stop()

    def reset(self, u_prev: ArrayLike = 0.0) -> None:
        """Forget everything: the robot rests under the inputs ``u_prev``, a number or (m,)."""
        held = np.asarray(u_prev, dtype=float)
        if held.shape not in ((), (self._inputs,)):
            raise ValueError(f"u_prev has shape {held.shape}; this controller takes a number or ({self._inputs},)")
        self._request(b"RESE", np.broadcast_to(held, (self._inputs,)))
        self.info = ControllerInfo()

    def step(self, y: ArrayLike, reference: ArrayLike, disturbance: ArrayLike | None = None) -> np.ndarray:
        """Inputs (m,) for the coming sample. Only shapes are refused here: numbers are the controller's to judge.

        Parameters
        ----------
        y
            (p,), measured now, after the last inputs have been held for one sample.
        reference
            (p,), held, or a preview (k, p) whose row 0 is wanted one sample from now; rows beyond the controller's
            preview are ignored, and the last row is held when there are fewer.
        disturbance
            (k,), measured now; of controllers with measured disturbances.

        Raises
        ------
        ValueError
            A shape does not fit.
        EmulatorError
            The controller broke off.
        """
        machine = self._running()
        measured, known = (np.asarray([] if value is None else value, dtype=float) for value in (y, disturbance))
        for name, value, size in (("y", measured, self._outputs), ("disturbance", known, self._disturbances)):
            if value.shape != (size,):
                raise ValueError(f"{name} has shape {value.shape}; this controller takes ({size},)")
        rows = np.atleast_2d(np.asarray(reference, dtype=float))
        if rows.ndim != 2 or rows.shape[1] != self._outputs or not len(rows):
            p, shape = self._outputs, np.shape(reference)
            raise ValueError(f"reference has shape {shape}; this controller takes ({p},) or a preview (k, {p})")
        self._request(b"STEP", measured, rows[np.minimum(np.arange(self._preview), len(rows) - 1)], known)
        instructions, stack, *counts = struct.unpack("<2I7i", machine.read(36))
        numbers = np.frombuffer(machine.read((2 + self._inputs) * self._real.itemsize), self._real).astype(float)
        self.info = ControllerInfo(
            **dict(zip(_COUNTS, counts, strict=True)),
            residual=float(numbers[0]),
            worst_residual=float(numbers[1]),
        )
        self.samples.append(Sample(self.info.status, self.info.iterations, instructions, stack))
        return numbers[2:]

    def run_random(self, samples: Iterable[tuple[np.ndarray | None, tuple[np.ndarray, ...]]]) -> None:
        """Meet samples as :meth:`ControllerRecord.random_samples` gives them, as long as they do not take too long."""
        begin = len(self.samples)
        for held, sample in samples:
            if held is not None:
                self.reset(held)
            self.step(*sample)
            if sum(done.instructions for done in self.samples[begin:]) > _MOST_INSTRUCTIONS:
                return

    @property
    def footprint(self) -> Footprint:
        """What the controller asks of the microcontroller, from its image and all steps until now."""
        if not self.samples:
            raise EmulatorError("the footprint is told from steps, and there was none yet")
        counts = [sample.instructions for sample in self.samples]
        return Footprint(
            flash=self.firmware.flash,
            ram=self.firmware.ram,
            stack=max(sample.stack for sample in self.samples),
            instructions_median=round(float(np.median(counts))),
            instructions_worst=max(counts),
            iterations_worst=max(sample.iterations for sample in self.samples),
            image_flash=self.firmware.image_flash,
            image_ram=self.firmware.image_ram,
        )

    def _greet(self, machine: Machine) -> None:
        machine.expect(b"HELL")
        words = struct.unpack("<7I", machine.read(28))
        real, self._outputs, self._inputs, self._preview, self._disturbances, counted, true = words
        self._real = np.dtype(f"<f{real}")
        if counted != true:
            raise EmulatorError(
                f"instructions cannot be counted: qemu-system-arm finds {counted} where there are {true}"
            )
        for name, there in (("outputs", self._outputs), ("inputs", self._inputs)):
            if there != (specified := getattr(self.mpc, name)):
                raise EmulatorError(f"the exported controller has {there} {name}, its specification {specified}")

    def _running(self) -> Machine:
        if self._machine is None or not self._machine.running:
            raise EmulatorError("no emulator runs: use the controller inside its 'with' statement, until it breaks off")
        return self._machine

    def _request(self, word: bytes, *numbers: np.ndarray) -> None:
        machine = self._running()
        # What a float cannot hold becomes infinite: the controller has to cope with that, too.
        with np.errstate(over="ignore"):
            machine.send(word + b"".join(array.astype(self._real).tobytes() for array in numbers))
        machine.expect(word)
