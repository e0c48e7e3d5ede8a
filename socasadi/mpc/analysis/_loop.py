"""The closed loop while no bound is active: linear, and exactly that of the controller's step."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model import StateSpace
from ..formulation import Design

if TYPE_CHECKING:
    from .._spec import LinearMPC


def decays(radius: float) -> bool:
    """Whether a spectral radius is that of a stable system; a billion samples are taken for ever."""
    return radius < 1 - 1e-9


@dataclass(frozen=True, eq=False)
class Loop:
    r"""The loop :math:`X_+ = A X + B e`, :math:`(y, v) = C X + D e`, v scaled, ``starts`` parting e = (r, d, i, w, n).

    r is the reference, the same in all rows; d is added to the outputs, measured and true; i, in shares of u_max, to
    the inputs of the plant; w are measured disturbances; n is added to the measurement only.
    X = (plant's state, the last delay + 1 inputs, newest first, the observer's state after the last sample).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    starts: tuple[int, ...]
    outputs: int

    def driven(self, by: str) -> slice:
        """The columns of B and D that belong to one letter of e."""
        place = "rdiwn".index(by)
        return slice(self.starts[place], self.starts[place + 1])


def prediction_model(mpc: "LinearMPC", design: Design) -> StateSpace:
    """The model that a design predicts with, in newtons and with the measured disturbances behind the inputs."""
    m, delay = mpc.inputs, mpc.delay
    n = design.order - mpc.outputs - ((delay + 1) * m if delay else 0)
    A, C, B, D = design.A[:n, :n], design.C[:, :n], design.B[:n], design.D
    if delay:
        acts, seen = n + (delay - 1) * m, n + delay * m
        B, D = design.A[:n, acts : acts + m], design.C[:, seen : seen + m]
    return StateSpace(A, np.hstack([B / mpc.input_scale, design.E[:n]]), C, np.hstack([D / mpc.input_scale, design.F]))


def closed_loop(mpc: "LinearMPC", design: Design, plant: StateSpace, factor: float = 1.0) -> Loop:
    """The loop around a plant whose outputs are ``factor`` times those of ``plant`` (factor 0: the loop is open).

    A sample: y is measured, the observer predicts with the input before and is corrected by y, the law gives the input
    from that very estimate, and the plant moves. The plant's inputs, too, act ``mpc.delay`` samples late.
    """
    n, m, k, p, ne = len(plant.A), mpc.inputs, mpc.measured_disturbances, mpc.outputs, design.order
    held = (mpc.delay + 1) * m
    state = {"x": n, "held": held, "observer": ne}
    given = {"r": p, "d": p, "i": m, "w": k, "n": p}
    columns = {**state, **given}
    starts = dict(zip(columns, np.cumsum([0, *columns.values()]), strict=False))

    def linear(rows: int, **blocks: np.ndarray) -> np.ndarray:
        matrix = np.zeros((rows, sum(columns.values())))
        for name, block in blocks.items():
            matrix[:, starts[name] : starts[name] + columns[name]] = block
        return matrix

    def past(samples: int) -> np.ndarray:
        return linear(m, held=np.eye(m, held, k=(samples - 1) * m))

    B, E = np.split(plant.B, [m], axis=1)
    D, F = np.split(plant.D, [m], axis=1)
    B, D = B * mpc.input_scale, D * mpc.input_scale
    disturbed = linear(m, i=np.eye(m))
    y = factor * (linear(p, x=plant.C, w=F) + D @ (past(mpc.delay + 1) + disturbed)) + linear(p, d=np.eye(p))

    before = past(1)
    predicted = linear(ne, observer=design.A, w=design.E) + design.B @ before
    innovation = y + linear(p, n=np.eye(p)) - design.C @ predicted - design.D @ before - linear(p, w=design.F)
    observer = predicted + design.gain @ innovation

    on_x, on_v, on_rows, on_w, _ = np.split(design.law, np.cumsum([ne, m, design.preview * p, k]), axis=1)
    v = on_x @ observer + on_v @ before + linear(m, r=on_rows.reshape(m, -1, p).sum(axis=1), w=on_w)

    acting = past(mpc.delay) if mpc.delay else v
    x = linear(n, x=plant.A, w=E) + B @ (acting + disturbed)
    kept = np.vstack([v, linear(held - m, held=np.eye(held - m, held))])

    whole = sum(state.values())
    (A_loop, B_loop), (C_loop, D_loop) = (
        np.split(np.vstack(parts), [whole], axis=1) for parts in ((x, kept, observer), (y, v))
    )
    return Loop(A_loop, B_loop, C_loop, D_loop, tuple(int(s) for s in np.cumsum([0, *given.values()])), p)


def regulator_matrix(mpc: "LinearMPC", design: Design, model: StateSpace) -> np.ndarray:
    """The loop around the prediction model where the observer knows its state: on (x, the last delay + 1 inputs)."""
    n, m = len(model.A), mpc.inputs
    held = (mpc.delay + 1) * m
    before = np.eye(m, n + held, k=n)
    law = design.law[:, design.order : design.order + m] @ before
    law[:, :n] += design.law[:, :n]
    if mpc.delay:
        law[:, n:] += design.law[:, n : n + held]
    acting = np.eye(m, n + held, k=n + (mpc.delay - 1) * m) if mpc.delay else law
    x = np.eye(n, n + held)
    moved = model.A @ x + model.B[:, :m] * mpc.input_scale @ acting
    return np.vstack([moved, law, np.eye(held - m, n + held, k=n)])
