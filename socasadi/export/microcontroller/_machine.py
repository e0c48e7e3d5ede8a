import os
import selectors
import subprocess
import tempfile
import time
from contextlib import suppress
from typing import NoReturn

from ._firmware import LONGEST_CALL, EmulatorError, Firmware

_FAULT, _ENDLESS = b"FAUL", b"ENDL"

_CODE_SIZE = 0x400000

# Bits of the configurable fault status register (Armv7-M Architecture Reference Manual, B3.2.15).
_FAULTS = (
    (0x2, "it accessed {data:#010x}, where nothing may be written, or nothing at all"),
    (0x200, "it accessed {bus:#010x}, where there is no memory"),
    (0x60101, "it jumped to where there is no code"),
    (0x10000, "it met an instruction that this core does not have"),
    (0x80000, "it used a coprocessor that this core does not have"),
    (0x1000000, "it accessed an address that is not aligned"),
)


class Machine:
    """A QEMU process that runs a firmware, and the bytes that go to and fro; ended by :meth:`stop` or any error."""

    def __init__(self, firmware: Firmware, timeout: float) -> None:
        self.firmware, self.timeout = firmware, timeout
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed by stop)
        command = ["qemu-system-arm", "-M", firmware.core.machine, "-kernel", str(firmware.image)]
        command += ["-nodefaults", "-nic", "none", "-display", "none", "-monitor", "none", "-serial", "none"]
        # The firmware relies on what shift says: an instruction takes 2^7 ns of the machine's time.
        command += ["-semihosting-config", "enable=on,target=native", "-icount", "shift=7"]
        try:
            # In a session of its own, so that Ctrl-C reaches Python alone. Should Python be killed, the firmware ends
            # the machine when its input ends.
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                bufsize=0,
                start_new_session=True,
            )
        except OSError as error:
            raise EmulatorError(f"qemu-system-arm does not start: {error}") from error
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout

    @property
    def running(self) -> bool:
        return not self._output.closed

    def send(self, message: bytes) -> None:
        try:
            while message:
                message = message[self._input.write(message) :]
        except OSError:
            self._fail("it ended by itself")

    def expect(self, word: bytes) -> None:
        """Read the first four bytes of an answer."""
        said = self.read(4)
        if said == word:
            return
        if said not in (_FAULT, _ENDLESS):
            self._fail(f"it said {said!r} for {word!r}")
        status, data, bus, address = (int.from_bytes(self.read(4), "little") for _ in range(4))
        what = f"it was not done after {LONGEST_CALL:,} instructions"
        if said == _FAULT:
            what = _explained(status, data, bus)
        if not address:  # the firmware found the stack pointer outside of the stack
            what = "its stack overflowed"
        elif address < _CODE_SIZE:
            what += f" (in {self.firmware.function_at(address)}, at {address:#x})"
        self._fail(what)

    def read(self, size: int) -> bytes:
        answer, deadline = b"", time.monotonic() + self.timeout
        with selectors.DefaultSelector() as selector:
            selector.register(self._output, selectors.EVENT_READ)
            while len(answer) < size:
                if not selector.select(max(0.0, deadline - time.monotonic())):
                    self._fail(f"it gave no answer within {self.timeout:g} s")
                if not (piece := os.read(self._output.fileno(), size - len(answer))):
                    self._fail("it ended by itself")
                answer += piece
        return answer

    def stop(self) -> None:
        """End the process, and wait until it has ended; twice does no harm."""
        self._process.kill()
        self._process.wait()
        with suppress(OSError):
            self._input.close()
        self._output.close()
        self._errors.close()

    def _fail(self, what: str) -> NoReturn:
        self._process.kill()
        self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").splitlines()
        self.stop()
        # Of warnings there is always one, that the board's network is not connected.
        said = "".join(f"\n{line}" for line in lines if ": warning: " not in line)
        raise EmulatorError(f"{self.firmware.name!r} on the emulated {self.firmware.core.name} broke off: {what}{said}")


def _explained(status: int, data: int, bus: int) -> str:
    for bits, what in _FAULTS:
        if status & bits:
            return what.format(data=data, bus=bus)
    return f"it met a fault of status {status:#010x}"
