from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from ...campaign import Pilot
from ...model import Entry, Record
from ...mpc import LinearMPC
from ..lab import Forecast, Lab, Law, Probed, Program, check_count, looked_ahead, tuned


@dataclass(frozen=True)
class Koopman(Probed):
    """MPC on a linear model of lifted outputs, fitted by extended dynamic mode decomposition (EDMD).

    Bruder, Gillespie, Remy, Vasudevan, "Modeling and control of soft robots using the Koopman operator and model
    predictive control", RSS 2019 (arXiv 1902.02827); Bruder et al., IEEE Trans. Robotics 37, 2020. The lifting holds
    outputs and inputs of the last samples, and monomials of the outputs among them; the lifted state comes from
    measurements at every sample. Beyond the papers what the prediction of the lifted state misses at rest is estimated
    and added to each step that is looked ahead, so that there is no steady error. How many samples are lifted, the
    ridge of the fit, the gain of that estimate and a factor on R are tuned by flights.

    Parameters
    ----------
    probing
        s of probing.
    delays
        Samples that are lifted, at most.
    degree
        Of the monomials of the last two samples' outputs, at most.
    """

    delays: int = 40
    degree: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count(1, degree=self.degree)
        check_count(2, delays=self.delays)

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        mpc, record = lab.study.mpc, lab.probe(self.probing, least=2 * (self.delays + 1))
        knobs = (
            Entry("delays", "samples", 1.5, self.delays + 0.5, "log"),
            Entry("ridge", "1", 1e-7, 1e1, "log"),
            Entry("gain of what is missed", "1", 1e-4, 1.0, "log"),
            Entry("effort", "1", 0.01, 100.0, "log"),
        )
        return tuned(
            lab, knobs, lambda x: _Controller(self, mpc, record, *x), initial=[(min(5.0, self.delays), 1e-3, 0.2, 1.0)]
        )


class _Controller(Law):
    def __init__(
        self,
        method: Koopman,
        mpc: LinearMPC,
        record: Record,
        delays: float,
        ridge: float,
        gain: float,
        effort: float,
    ) -> None:
        super().__init__(mpc)
        self._delays = d = round(delays)
        self._method, self._gain, p, m, N = method, gain, mpc.outputs, mpc.inputs, mpc.horizon
        self._unit = float(np.abs(record.output).max())  # so that monomials are of the size of what they are made of
        u, y = record.tension / mpc.input_scale, record.output
        lifted = np.array([self._lift(y[t - d : t + 1][::-1], u[t - d : t][::-1]) for t in range(d, len(u) + 1)])
        known = np.hstack([lifted[:-1], u[d:]])
        size = lifted.shape[1]
        fitted = np.linalg.solve(known.T @ known + ridge * len(known) * np.eye(known.shape[1]), known.T @ lifted[1:]).T
        self._A, self._B = fitted[:, :size], fitted[:, size:]
        # Outputs over the horizon: from the lifted state, what each step misses of it, and each input.
        C = self._unit * np.eye(size)[:p]
        powers = [C]
        for _ in range(N):
            powers.append(powers[-1] @ self._A)
        total = 2 * size + N * p + m
        by_state, by_missed = np.vstack(powers[1:]), np.cumsum(powers[:-1], axis=0).reshape(N * p, size)
        by_input = np.zeros((N * p, N * m))
        for k in range(N):
            for j in range(k + 1):
                by_input[k * p : (k + 1) * p, j * m : (j + 1) * m] = powers[k - j] @ self._B
        known_part = np.hstack([by_state, by_missed, np.zeros((N * p, N * p + m))])
        reference = np.eye(total)[2 * size : 2 * size + N * p]
        inputs = (np.eye(N * m), np.zeros((N * m, total)))
        self._program = Program(mpc, Forecast(inputs, (by_input, known_part), reference, np.eye(total)[-m:]), effort)
        self.begin()

    def begin(self) -> None:
        self._program.forget()
        self._u = np.tile(self.held / self.mpc.input_scale, (self._delays, 1))
        self._y: np.ndarray | None = None
        self._missed, self._lifted = np.zeros(len(self._A)), None

    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        before = self.held / self.mpc.input_scale
        if self._y is None:  # it was at rest so far
            self._y = np.tile(y, (self._delays + 1, 1))
        else:
            self._y = np.vstack([y, self._y[:-1]])
            self._u = np.vstack([before, self._u[:-1]])
        lifted = self._lift(self._y, self._u)
        if self._lifted is not None:
            missed = lifted - self._A @ self._lifted - self._B @ before
            self._missed = self._missed + self._gain * (missed - self._missed)
        self._lifted = lifted
        ahead = looked_ahead(reference, self.mpc.horizon)
        parameters = np.concatenate([lifted, self._missed, ahead, before], axis=None)
        return self._program.inputs(parameters, self.info)[0]

    def predicted(self, tension: np.ndarray) -> np.ndarray:
        y, u = np.zeros((self._delays + 1, self.mpc.outputs)), np.zeros((self._delays, self.mpc.inputs))
        lifted, outputs = self._lift(y, u), []
        for share in tension / self.mpc.input_scale:
            lifted = self._A @ lifted + self._B @ share
            outputs.append(self._unit * lifted[: self.mpc.outputs])
        return np.array(outputs)

    def _lift(self, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Newest first: outputs (delays + 1, p), m, and inputs (delays, m), as shares -> the lifted state."""
        y = y.ravel() / self._unit
        factors = range(2 * self.mpc.outputs)
        monomials = [
            y[list(combinations_with_replacement(factors, degree))].prod(axis=1)
            for degree in range(2, self._method.degree + 1)
        ]
        return np.concatenate([y, u.ravel(), *monomials, [1.0]])
