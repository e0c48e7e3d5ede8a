import ctypes
import functools
from importlib.resources import files
from typing import Any

import numpy as np

from ..codegen import shared_library
from ._tables import ProgramTables, Real, Tables

# What C asks for its memory, for callers that cannot read its macros.
_SIZES = """
#include "mpc.h"
int mpc_layout(void);
int mpc_reals(const mpc_data *d);
int mpc_ints(const mpc_data *d);
int qp_reals(const qp_problem *p);
int qp_ints(const qp_problem *p);
int mpc_layout(void) { return (int)(sizeof(mpc) + sizeof(mpc_data)); }
int mpc_reals(const mpc_data *d) {
    return MPC_REALS(d->order, d->inputs, d->outputs, d->disturbances, d->preview, d->qp.rows);
}
int mpc_ints(const mpc_data *d) { return MPC_INTS(d->qp.rows); }
int qp_reals(const qp_problem *p) { return QP_REALS(p->rows); }
int qp_ints(const qp_problem *p) { return QP_INTS(p->rows); }
"""
# No contraction of a * b + c, so that the same C gives the same doubles on every processor.
_FLAGS = ("-std=c99", "-ffp-contract=off")


def controller_sources() -> dict[str, str]:
    """The controller's C by file name: real.h, qp.h, qp.c, mpc.h, mpc.c."""
    folder = files("socasadi.mpc").joinpath("c")
    return {source.name: source.read_text() for source in sorted(folder.iterdir(), key=lambda source: source.name)}


@functools.cache
def library(real: Real) -> "Library":
    """The controller's C for one number type, compiled and loaded once."""
    return Library(real)


class Library:
    """Structures of qp.h and mpc.h for one number type, and the compiled library."""

    def __init__(self, real: Real) -> None:
        self.dtype = np.dtype(np.float64 if real == "double" else np.float32)
        number: Any = ctypes.c_double if real == "double" else ctypes.c_float
        array, indices = ctypes.POINTER(number), ctypes.POINTER(ctypes.c_int)
        self._array = array

        def structure(name: str, **fields: Any) -> type[ctypes.Structure]:
            return type(name, (ctypes.Structure,), {"_fields_": list(fields.items())})

        def all_of(kind: Any, names: str) -> dict[str, Any]:
            return dict.fromkeys(names.split(), kind)

        self.Problem = structure(
            "Problem",
            **all_of(ctypes.c_int, "rows iterations"),
            **all_of(array, "gram lower upper softness price unit"),
        )
        self.Solver = structure(
            "Solver",
            problem=ctypes.POINTER(self.Problem),
            **all_of(array, "value multiplier"),
            **all_of(ctypes.c_int, "iterations active"),
            **all_of(indices, "row state"),
            **all_of(array, "factor diagonal direction"),
        )
        self.Data = structure(
            "Data",
            **all_of(ctypes.c_int, "order inputs outputs disturbances preview"),
            **all_of(number, "tolerance plausible"),
            **all_of(array, "A B E C D F gain rest map scale lower upper slowest fastest"),
            qp=self.Problem,
        )
        self.Info = structure(
            "Info",
            **all_of(ctypes.c_int, "status iterations"),
            residual=number,
            **all_of(ctypes.c_ulong, "steps clipped held refused"),
            worst_iterations=ctypes.c_int,
            worst_residual=number,
        )
        self.Mpc = structure(
            "Mpc",
            data=ctypes.POINTER(self.Data),
            info=self.Info,
            **all_of(array, "x v w predicted innovation parameters centre"),
            solver=self.Solver,
        )
        flags = (*_FLAGS, *(["-DREAL_FLOAT"] if real == "float" else []))
        sources = {**controller_sources(), "sizes.c": _SIZES}
        self.c = ctypes.CDLL(str(shared_library(f"mpc-{real}", sources, flags=flags)))
        for function in (self.c.mpc_init, self.c.mpc_reset, self.c.qp_init, self.c.qp_reset):
            function.restype = None
        self.c.qp_residual.restype = number
        # A field that the headers have gained and the structures above have not would corrupt memory.
        assert self.c.mpc_layout() == ctypes.sizeof(self.Mpc) + ctypes.sizeof(self.Data)

    def pointer(self, array: np.ndarray) -> Any:
        """Of an array of reals, or of ints."""
        return array.ctypes.data_as(self._array if array.dtype == self.dtype else ctypes.POINTER(ctypes.c_int))

    def program(self, given: ProgramTables) -> tuple[ctypes.Structure, list[np.ndarray]]:
        """qp_problem of these tables, and the arrays that have to live as long as it is used."""
        kept, pointers = self._pointers(given.arrays)
        return self.Problem(rows=given.rows, iterations=given.iterations, **pointers), kept

    def data(self, given: Tables) -> tuple[ctypes.Structure, list[np.ndarray]]:
        """mpc_data of these tables, and the arrays that have to live as long as it is used."""
        problem, kept = self.program(given.program)
        more, pointers = self._pointers(given.arrays)
        return self.Data(**given.sizes, **given.limits, **pointers, qp=problem), kept + more

    def _pointers(self, arrays: dict[str, np.ndarray]) -> tuple[list[np.ndarray], dict[str, Any]]:
        kept = [np.ascontiguousarray(array, dtype=self.dtype) for array in arrays.values()]
        return kept, dict(zip(arrays, map(self.pointer, kept), strict=True))
