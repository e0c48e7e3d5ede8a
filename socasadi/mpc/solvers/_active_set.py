import ctypes
from typing import NamedTuple

import numpy as np

from .._library import library
from .._tables import KKT_TOLERANCES, Real, program_tables
from ..formulation import DualProgram


class RowAnswer(NamedTuple):
    """What the solver in C makes of a program, in the units that its rows had before they were scaled."""

    values: np.ndarray
    """(rows,)"""
    multipliers: np.ndarray
    """(rows,) positive where an upper bound is active, negative at a lower one."""
    residual: float
    """Of the optimality conditions, see ``qp_residual`` in qp.h."""
    iterations: int


class ActiveSet:
    """The dual active-set solver in C (see qp.h), for programs that differ in their parameters only.

    Each solution starts from the working set of the one before, if that was good.

    Raises
    ------
    CompilationError
        There is no C compiler.
    """

    def __init__(self, dual: DualProgram, real: Real = "double") -> None:
        self._dual, self._real, self._library = dual, real, library(real)
        c, number, pointer = self._library.c, self._library.dtype, self._library.pointer
        self._problem, self._kept = self._library.program(program_tables(dual))
        problem = ctypes.byref(self._problem)
        self._reals, self._ints = np.zeros(c.qp_reals(problem), number), np.zeros(c.qp_ints(problem), np.intc)
        self._self = self._library.Solver()
        c.qp_init(ctypes.byref(self._self), problem, pointer(self._reals), pointer(self._ints))

    def forget(self) -> None:
        """Start the next solution from no working set."""
        self._library.c.qp_reset(ctypes.byref(self._self))

    def solve(self, parameters: np.ndarray) -> RowAnswer:
        """Solve for the parameters of the dual program's map."""
        rows = len(self._dual.unit)
        centre = np.ascontiguousarray(self._dual.map @ parameters, dtype=self._library.dtype)
        itself, given = ctypes.byref(self._self), self._library.pointer(centre)
        self._library.c.qp_solve(itself, given)
        residual = float(self._library.c.qp_residual(itself, given))
        values, multipliers = self._reals[:rows].astype(float), self._reals[rows : 2 * rows].astype(float)
        answer = RowAnswer(values * self._dual.unit, multipliers / self._dual.unit, residual, self._self.iterations)
        if not residual <= KKT_TOLERANCES[self._real]:
            self.forget()
        return answer
