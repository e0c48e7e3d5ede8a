from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from .formulation import Design, DualProgram

if TYPE_CHECKING:
    from ._spec import LinearMPC

Real = Literal["double", "float"]
"""Number types of the controller in C."""

_UNBOUNDED = 1e30
"""Stands for an infinite bound: single precision holds it, too."""

KKT_TOLERANCES = {"double": 1e-6, "float": 1e-2}
"""Largest KKT residual of an answer that is believed, in shares of the bounds, by the number type."""


def check_real(real: str) -> None:
    """ValueError when no number type goes by that name."""
    if real not in get_args(Real):
        raise ValueError(f"unknown real {real!r}; there are {', '.join(get_args(Real))}")


@dataclass(frozen=True, eq=False)
class ProgramTables:
    """What the QP solver in C is given: fields of ``qp_problem`` (see qp.h)."""

    rows: int
    iterations: int
    arrays: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Tables:
    """What the controller in C is given: fields of ``mpc_data`` (see mpc.h) by name.

    Attributes
    ----------
    sizes, limits
        Its integers and its numbers.
    arrays
        Its arrays, flat, in the order in which C reads them; ``slowest`` and ``fastest`` only where there are rate
        bounds.
    program
        Its quadratic program.
    """

    sizes: dict[str, int]
    limits: dict[str, float]
    arrays: dict[str, np.ndarray]
    program: ProgramTables


def program_tables(dual: DualProgram, iteration_limit: int | None = None) -> ProgramTables:
    """The tables of one quadratic program."""
    rows = len(dual.unit)
    arrays = {
        "gram": dual.gram[np.tril_indices(rows)],
        "lower": _finite(dual.lower),
        "upper": _finite(dual.upper),
        "softness": dual.softness,
        "price": dual.price,
        "unit": dual.unit,
    }
    # Random problems with many active bounds took up to two changes a row, tracking problems seldom one.
    return ProgramTables(rows, iteration_limit or 50 + 2 * rows, arrays)


def tables(mpc: "LinearMPC", design: Design, real: Real = "double") -> Tables:
    """The tables of one controller, in double precision; ``real`` is what C will compute in."""
    lower, upper = mpc.input_limits
    arrays = {
        **{name: getattr(design, name) for name in ("A", "B", "E", "C", "D", "F", "gain", "rest")},
        "map": design.dual.map.T,
        "scale": mpc.input_scale,
        "lower": lower,
        "upper": upper,
    }
    if mpc.rate_limits is not None:
        arrays["slowest"], arrays["fastest"] = (
            _finite(limit * mpc.sample_time / mpc.input_scale) for limit in mpc.rate_limits
        )
    return Tables(
        sizes={name: getattr(design, name) for name in ("order", "inputs", "outputs", "disturbances", "preview")},
        limits={"tolerance": KKT_TOLERANCES[real], "plausible": float(design.plausible)},
        arrays={name: np.ravel(array) for name, array in arrays.items()},
        program=program_tables(design.dual, mpc.iteration_limit),
    )


def _finite(bounds: np.ndarray) -> np.ndarray:
    return np.clip(bounds, -_UNBOUNDED, _UNBOUNDED)
