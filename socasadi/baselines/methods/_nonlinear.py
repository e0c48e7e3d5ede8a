from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import casadi as ca
import numpy as np

from ...campaign import Pilot
from ...codegen import Buffered, compiled
from ...model import Fixed
from ...mpc import LinearMPC
from ...plant import SimulatedPlant
from ...rod import Strain
from ..lab import BESIDE_MODEL, Forecast, Information, Lab, Law, Method, Program, check_count, looked_ahead, tuned
from ._fixed import known_rod, linearised
from ._sampled import sampled


@dataclass(frozen=True)
class NonlinearMPC(Method):
    """MPC on the rod that is known: what can be reached with a model of the robot, in real time or not.

    Gauss-Newton sequential quadratic programming (Diehl, Bock, Schlöder, "A real-time iteration scheme for nonlinear
    optimization in optimal feedback control", SIAM J. Control and Optimization 43, 2005), one program a sample, started
    from the solution before, on states that an extended Kalman filter estimates along with a constant disturbance of
    the outputs. The bounds are those of the study's MPC; what it weighs and what the observer assumes is tuned by
    flights, as in :class:`WeightSearch`.

    Parameters
    ----------
    model
        ``"rod"``, as it is known; ``"constant curvature"``, the same with one curvature about each axis along all of
        its length and nothing else.
    tuned
        Settings of the study's MPC that are tuned, as of :class:`LinearMPC`.
    doubt
        The factor on ``"input_noise"`` that is flown first: a model that is the robot itself may be trusted, and one of
        constant curvature may not.
    trials
        Of the tuning, at most: seconds of computing each.
    """

    model: Literal["rod", "constant curvature"] = "rod"
    tuned: tuple = BESIDE_MODEL
    doubt: float = 0.01
    trials: int = 60

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count(1, trials=self.trials)

    @property
    def information(self) -> Information:
        return "plant model"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        plant = known_rod(lab)
        rod = plant.rod if self.model == "rod" else replace(plant.rod, strain=Strain(bending_y=0, bending_z=0))
        believed = SimulatedPlant(rod, plant.sample_time, 0.0, plant.output)
        advance = compiled(sampled(believed, plant.inputs))
        # The rod takes the place of the model, so that nothing but the settings is left open.
        searched = replace(lab.study.mpc, model=Fixed.of(linearised(lab), plant.sample_time), tuned=self.tuned)
        first = [self.doubt if entry.name.startswith("input_noise") else 1.0 for entry in searched.entries]
        build = partial(_Controller, plant=believed, advance=advance)
        return tuned(lab, searched.entries, lambda x: build(searched.at(x)), initial=[first], most=self.trials)


class _Controller(Law):
    def __init__(self, mpc: LinearMPC, plant: SimulatedPlant, advance: ca.Function) -> None:
        super().__init__(mpc)
        self._rod, self._rest, self._advance = plant.rod, plant.sensor, Buffered(advance)
        self.begin()

    def begin(self) -> None:
        order, p = 2 * self._rod.dof, self.mpc.outputs
        self._x = self._rod.equilibrium(self.held).state
        self._disturbance = np.zeros(p)
        self._planned = np.tile(self.held, (self.mpc.horizon, 1))
        # It rests where it is thought to rest, but for what the model gets wrong.
        self._covariance = np.diag(np.concatenate([np.full(order, 1e-10), np.full(p, 1e-4)]))
        self._first = True

    def act(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        self._estimate(y)
        self._planned = np.vstack([self._planned[1:], self._planned[-1:]])
        self._planned = self._improved(looked_ahead(reference, self.mpc.horizon))
        if not np.isfinite(self._planned).all():
            self._planned = np.tile(self.held, (self.mpc.horizon, 1))
            return np.full(self.mpc.inputs, np.nan)
        return self._planned[0]

    def predicted(self, tension: np.ndarray) -> np.ndarray:
        x, outputs = self._rod.equilibrium(np.zeros(self.mpc.inputs)).state, []
        for u in tension:
            x, *_, y, _ = self._sample(x, u)
            outputs.append(y)
        return np.array(outputs)

    def _sample(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
        """State a sample later, its derivatives by x and u, output then, its derivative by that state."""
        after, slopes, y, C = self._advance(x, u)
        n = len(x)
        # CasADi's matrices come column by column.
        A, B = np.split(slopes.reshape(-1, n).T, [n], axis=1)
        return after, A, B, y, C.reshape(n, len(y)).T

    def _estimate(self, y: np.ndarray) -> None:
        """Correct what is believed of state and disturbance by a measurement (extended Kalman filter)."""
        noise, n, p = self.mpc.noise, len(self._x), self.mpc.outputs
        if self._first:
            expected, C = (value.full() for value in (self._rest(self._x), self._rest.jacobian()(self._x, 0)))
        else:
            self._x, A, B, expected, C = self._sample(self._x, self.held)
            self._covariance[:n] = A @ self._covariance[:n]
            self._covariance[:, :n] = self._covariance[:, :n] @ A.T
            self._covariance[:n, :n] += B @ noise.input @ B.T
            self._covariance[n:, n:] += noise.disturbance
        self._first = False
        seen = np.hstack([C, np.eye(p)])
        spread = seen @ self._covariance @ seen.T + noise.measurement
        gain = np.linalg.solve(spread, seen @ self._covariance).T
        correction = gain @ (y - expected.ravel() - self._disturbance)
        self._x, self._disturbance = self._x + correction[:n], self._disturbance + correction[n:]
        self._covariance = self._covariance - gain @ seen @ self._covariance

    def _improved(self, wanted: np.ndarray) -> np.ndarray:
        """The plan (N, m) after one more program, about the flight that the present one gives."""
        N, (p, m), scale = self.mpc.horizon, (self.mpc.outputs, self.mpc.inputs), self.mpc.input_scale
        x, by_plan = self._x, np.zeros((len(self._x), N * m))
        expected, slopes = np.zeros((N, p)), np.zeros((N, p, N * m))
        for k, u in enumerate(self._planned):
            x, A, B, expected[k], C = self._sample(x, u)
            by_plan = A @ by_plan
            by_plan[:, k * m : (k + 1) * m] += B * scale
            slopes[k] = C @ by_plan
        if not np.isfinite(slopes).all():
            return np.full_like(self._planned, np.nan)
        forecast = Forecast(
            input=(np.eye(N * m), (self._planned / scale).reshape(-1, 1)),
            output=(slopes.reshape(N * p, -1), (expected + self._disturbance).reshape(-1, 1)),
            reference=wanted.reshape(-1, 1),
            before=(self.held / scale)[:, None],
        )
        return Program(self.mpc, forecast).inputs(np.ones(1), self.info)
