"""The tracking problem that every solver is given, and what counts as its answer.

    min   sum over k = 1..N of (|y_k - r|^2 Q + rho |s_k|^2) / 2  +  sum over k = 0..N-1 of |u_k|^2 R / 2
    with  x_{k+1} = A x_k + B u_k,   y_k = C x_k,   |u_k| <= umax,   |y_k| <= ymax + s_k

for 200 pairs p = (x_0, r): four states, three inputs, two outputs, N = 10 (qp.json).
"""

import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np


@dataclass(frozen=True, eq=False)
class Program:
    """A condensed problem in inputs z, as shares of umax, and outputs, as shares of ymax, for parameters p.

        min   z'Hz/2 + (gradient p)'z + softening |s|^2 / 2   with   |z| <= 1,   |response z + free p| <= 1 + s

    Attributes
    ----------
    hessian, gradient, response, free
        (n, n), (n, parameters), (outputs of all samples, n) and (outputs of all samples, parameters); the last two have
        no rows where outputs are not bounded.
    softening
        Weight of the outputs' slacks.
    p
        (count, parameters) the parameters for which it is solved.
    first
        How many of z are the inputs of the first sample.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    response: np.ndarray
    free: np.ndarray
    softening: float
    p: np.ndarray
    first: int

    @property
    def inputs(self) -> int:
        return len(self.hessian)

    @property
    def soft(self) -> bool:
        return len(self.response) > 0

    @property
    def cost(self) -> float:
        """What the solvers that are not indifferent to it multiply the cost by: H then begins at 1."""
        return 1 / float(np.linalg.eigvalsh(self.hessian)[0])

    @cached_property
    def rows(self) -> np.ndarray:
        """What is bounded by one in magnitude: every input, then every output."""
        return np.vstack([np.eye(self.inputs), self.response])

    @cached_property
    def row_free(self) -> np.ndarray:
        return np.vstack([np.zeros_like(self.gradient), self.free])

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Distance of answers z (count, n) from optimality, as a share of umax: (count,).

        With s eliminated the problem is smooth in z with a box around it, and z is optimal where a step down the
        gradient, each input's by its own curvature, ends where it began once it is clipped to the box. So one measure
        serves all solvers, whatever they say about multipliers. NaN or infinity give infinity.
        """
        outputs = z @ self.response.T + self.p @ self.free.T
        exceeding = outputs - np.clip(outputs, -1, 1)
        slope = z @ self.hessian + self.p @ self.gradient.T + self.softening * exceeding @ self.response
        curvature = np.diag(self.hessian) + self.softening * (self.response**2).sum(axis=0)
        away = np.abs(z - np.clip(z - slope / curvature, -1, 1)).max(axis=1)
        return np.where(np.isfinite(away), away, np.inf)


@dataclass(frozen=True, eq=False)
class Case:
    """The tracking problem for a model: matrices, weights, bounds, and pairs `p` (count, states + outputs).

    `rho` = 0 leaves the bounds of the outputs out.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    Q: float
    R: float
    rho: float
    umax: float
    ymax: float
    horizon: int
    p: np.ndarray

    @property
    def states(self) -> int:
        return self.A.shape[0]

    @property
    def inputs(self) -> int:
        return self.B.shape[1]

    @property
    def outputs(self) -> int:
        return self.C.shape[0]

    @property
    def soft(self) -> bool:
        return self.rho > 0

    @cached_property
    def program(self) -> Program:
        """The problem without its states."""
        forced, free = predicted(self.A, self.B * self.umax, self.horizon)
        share = np.kron(np.eye(self.horizon), self.C / self.ymax)
        response, free, weight = share @ forced, share @ free, self.Q * self.ymax**2
        wanted = np.tile(np.eye(self.outputs) / self.ymax, (self.horizon, 1))
        hessian = weight * response.T @ response + self.R * self.umax**2 * np.eye(response.shape[1])
        gradient = weight * response.T @ np.hstack([free, -wanted])
        bounded = slice(None) if self.soft else slice(0)
        free = np.hstack([free, np.zeros_like(wanted)])[bounded]
        softening = self.rho * self.ymax**2
        return Program(hessian, gradient, response[bounded], free, softening, self.p, self.inputs)


def predicted(A: np.ndarray, B: np.ndarray, horizon: int) -> tuple[np.ndarray, np.ndarray]:
    """States x_1..x_N by the inputs (N n, N m) and by x_0 (N n, n)."""
    powers = [np.linalg.matrix_power(A, k) for k in range(horizon + 1)]
    n, m = B.shape
    forced = np.zeros((horizon * n, horizon * m))
    for i in range(horizon):
        for j in range(i + 1):
            forced[i * n : (i + 1) * n, j * m : (j + 1) * m] = powers[i - j] @ B
    return forced, np.vstack(powers[1:])


def case(soft: bool) -> Case:
    """The problem of qp.json, with soft bounds on the outputs or with none."""
    data = json.loads((Path(__file__).parent / "qp.json").read_text())
    model = {name: np.array(data[name]) for name in "ABC"}
    numbers = {name: data[name] for name in ("Q", "R", "rho", "umax", "ymax", "horizon")}
    problem = Case(**model, **numbers, p=np.hstack([data["x0"], data["r"]]))
    return problem if soft else replace(problem, rho=0.0)


def random_case(states: int, horizon: int = 10, count: int = 200) -> Case:
    """The same for a random model of lightly damped oscillators with the gain of a soft robot.

    It starts at rest under inputs anywhere within 0.9 umax and is to go anywhere within 1.5 ymax; weights are such that
    it wants to.
    """
    random, whole = np.random.default_rng(states), case(soft=True)
    A = np.zeros((states, states))
    for i in range(0, states - 1, 2):
        angle, radius = random.uniform(0.1, 0.8), random.uniform(0.85, 0.97)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        A[i : i + 2, i : i + 2] = radius * turn
    if states % 2:
        A[-1, -1] = random.uniform(0.5, 0.9)
    B, C = random.normal(size=(states, whole.inputs)), random.normal(size=(whole.outputs, states))
    at_rest = np.linalg.solve(np.eye(states) - A, B)
    C *= (1.4e-2 / np.linalg.norm(C @ at_rest, axis=1))[:, None]  # m/N
    x0 = (at_rest @ random.uniform(-0.9, 0.9, size=(whole.inputs, count)) * whole.umax).T
    r = random.uniform(-1.5, 1.5, size=(count, whole.outputs)) * whole.ymax
    return replace(whole, A=A, B=B, C=C, Q=1e5, rho=1e6, horizon=horizon, p=np.hstack([x0, r]))
