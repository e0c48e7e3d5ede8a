import ctypes
import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from ._controller import Controller, ControllerInfo
from ._library import library
from ._tables import Real, tables
from .formulation import Design

if TYPE_CHECKING:
    from ._spec import LinearMPC


class CompiledController(Controller):
    """The MPC in C: the very code that is exported, compiled for this machine and called here.

    Parameters
    ----------
    real
        What it computes in, ``"double"`` or ``"float"``.

    Raises
    ------
    CompilationError
        There is no C compiler, or it rejects the code.
    """

    def __init__(self, mpc: "LinearMPC", design: Design, real: Real = "double") -> None:
        super().__init__(mpc, design)
        self._library = library(real)
        c, number, pointer = self._library.c, self._library.dtype, self._library.pointer
        self._data, self._kept = self._library.data(tables(mpc, design, real))
        data = ctypes.byref(self._data)
        self._reals, self._ints = np.zeros(c.mpc_reals(data), number), np.zeros(c.mpc_ints(data), np.intc)
        sizes = (self._p, len(self._seen) * self._p, self._k, self._m)
        self._y, self._reference, self._w, self._u = (np.zeros(size, number) for size in sizes)
        self._self = self._library.Mpc()
        itself = ctypes.byref(self._self)
        self._arguments = (itself, *map(pointer, (self._y, self._reference, self._w, self._u)))
        c.mpc_init(itself, data, pointer(self._reals), pointer(self._ints))

    @property
    def info(self) -> ControllerInfo:
        told = self._self.info
        return ControllerInfo(**{field.name: getattr(told, field.name) for field in dataclasses.fields(ControllerInfo)})

    @property
    def _observed(self) -> np.ndarray:
        return self._reals[: len(self.design.A)].astype(float)

    def _rest(self, u_prev: np.ndarray) -> None:
        self._u[:] = u_prev
        self._library.c.mpc_reset(self._arguments[0], self._arguments[-1])

    def _advance(self, y: np.ndarray, reference: np.ndarray, w: np.ndarray) -> np.ndarray:
        self._y[:] = y
        self._reference[:] = reference.ravel()
        self._w[:] = w
        self._library.c.mpc_step(*self._arguments)
        return self._u.astype(float)
