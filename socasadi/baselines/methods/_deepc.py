from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import null_space

from ...campaign import Pilot
from ...model import Entry, Record
from ...mpc import LinearMPC
from ..lab import Forecast, Lab, Law, Probed, Program, looked_ahead, tuned

_LONGEST_PAST = 24
"""Samples."""


@dataclass(frozen=True)
class DeePC(Probed):
    r"""Data-enabled predictive control: a probing record takes the place of the model.

    Coulson, Lygeros, Dörfler, "Data-enabled predictive control: in the shallows of the DeePC", European Control
    Conference 2019. With the Hankel matrices :math:`U_p, Y_p, U_f, Y_f` of the record,

    .. math::
        \min_g\; \sum |y - r|_Q^2 + \rho_R(u) + \lambda_g |g|^2 + \lambda_y |Y_p g - y_{ini}|^2, \qquad
        U_p g = u_{ini},\; u = U_f g,\; y = Y_f g

    within the bounds of the study's MPC. How many samples make the past, both regularisations, and a factor on R are
    tuned by flights.

    Parameters
    ----------
    probing
        s of probing.
    velocity
        Whether the matrices hold changes from sample to sample, which leaves no steady error.
    """

    velocity: bool = False

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc = lab.study.mpc
        # As many as it takes for every course of inputs over the windows to be a combination of those in the record.
        record = lab.probe(self.probing, least=(mpc.inputs + 1) * (_LONGEST_PAST + mpc.horizon))
        knobs = (
            Entry("past", "samples", 4.0, float(_LONGEST_PAST), "log"),
            Entry("on the combination", "1", 1e-4, 1e3, "log"),
            Entry("on the past", "1/m2", 1e2, 1e8, "log"),
            Entry("effort", "1", 0.01, 100.0, "log"),
        )
        return tuned(lab, knobs, lambda x: _Controller(mpc, self.velocity, record, *x), initial=[(10.0, 1.0, 1e5, 1.0)])


class _Controller(Law):
    def __init__(
        self, mpc: LinearMPC, velocity: bool, record: Record, past: float, on_g: float, on_past: float, effort: float
    ) -> None:
        super().__init__(mpc)
        m, p, past, N = mpc.inputs, mpc.outputs, round(past), mpc.horizon
        self._past, self._velocity = past, velocity
        # An output belongs to the input that was held before it.
        u, y = record.tension / mpc.input_scale, record.output[1:]
        if velocity:
            u, y = np.diff(u, axis=0), np.diff(y, axis=0)
        # With g = Q h, where Q spans the rows of the matrices, nothing grows with the length of the record.
        matrices = np.vstack([_hankel(u, past + N), _hankel(y, past + N)])
        reduced = np.asarray(np.linalg.qr(matrices.T, mode="r")).T
        split = np.cumsum([past * m, N * m, past * p])
        Up, Uf, Yp, Yf = np.split(reduced, split)
        names = {"u": past * m, "y": past * p, "reference": N * p, "before": m, "now": p}
        places, total = {}, sum(names.values())
        for name, size in names.items():
            start = sum(map(np.size, places.values()))
            places[name] = np.arange(start, start + size)
        pick = {name: np.eye(total)[place] for name, place in places.items()}
        # h = known p + free z keeps U_p h = u_ini.
        known, free = np.linalg.pinv(Up, rcond=1e-8) @ pick["u"], null_space(Up, rcond=1e-8)
        input, output = (Uf @ free, Uf @ known), (Yf @ free, Yf @ known)
        if velocity:
            add_u, add_y = (np.kron(np.tril(np.ones((N, N))), np.eye(size)) for size in (m, p))
            input = (add_u @ input[0], add_u @ input[1] + np.tile(pick["before"], (N, 1)))
            output = (add_y @ output[0], add_y @ output[1] + np.tile(pick["now"], (N, 1)))
        missed = Yp @ known - pick["y"]
        own = (
            2 * (on_g * np.eye(free.shape[1]) + on_past * (Yp @ free).T @ (Yp @ free)),
            2 * (on_g * free.T @ known + on_past * (Yp @ free).T @ missed),
        )
        self._program = Program(mpc, Forecast(input, output, pick["reference"], pick["before"], own), effort)
        self.begin()

    def begin(self) -> None:
        self._program.forget()
        self._u = np.tile(self.held / self.mpc.input_scale, (self._past + 1, 1))
        self._y: np.ndarray | None = None

    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        before = self.held / self.mpc.input_scale
        if self._y is None:  # it was at rest so far
            self._y = np.tile(y, (self._past + 1, 1))
        else:
            self._y = np.vstack([self._y[1:], y])
            self._u = np.vstack([self._u[1:], before])
        u, past = (np.diff(self._u, axis=0), np.diff(self._y, axis=0)) if self._velocity else (self._u[1:], self._y[1:])
        ahead = looked_ahead(reference, self.mpc.horizon)
        return self._program.inputs(np.concatenate([u, past, ahead, before, y], axis=None), self.info)[0]


def _hankel(rows: np.ndarray, length: int) -> np.ndarray:
    """(length k, columns): windows of so many of the rows (T, k), one a column, sample after sample."""
    windows = sliding_window_view(rows, length, axis=0)
    return windows.transpose(2, 1, 0).reshape(-1, len(windows))
