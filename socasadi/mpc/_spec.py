import functools
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..model import PredictionModel, StateSpace
from ._design import Design, DesignError, design_function
from ._qp import BACKENDS, check_backend
from ._weights import InputTerm, Weight, bound_pair, check_input_term, hashable, weight_matrix

if TYPE_CHECKING:
    from ._controller import Controller


@dataclass(frozen=True)
class LinearMPC:
    r"""A constrained linear MPC in which only the prediction model is open.

    At every sample it estimates state and output disturbance with a Kalman filter and solves

    .. math::
        \min_{u, s}\; \sum_{k=1}^{N} |y_k - r_k|_Q^2 + \sum_{k=0}^{N-1} \rho_R(u_k)
            + V(x_N - x_s, u_{N-1} - u_s) + \lambda \sum_k |s_k|^2

    subject to :math:`u_{min} \le u_k \le u_{max}` (hard) and :math:`y_{min} - s_k \le y_k \le y_{max} + s_k`,
    :math:`s_k \ge 0` (soft). :math:`\rho_R` is the chosen input term, V the cost-to-go of the unconstrained problem,
    and :math:`(x_s, u_s)` the best steady state for the last reference under the estimated disturbance.

    Parameters
    ----------
    model
        Family of prediction models; theta picks one.
    sample_time
        s.
    horizon
        N, samples.
    Q
        Weight of the outputs, 1/m2: a number, p numbers or a (p, p) matrix.
    R
        Weight of the input term: a positive number, m positive numbers or a positive definite (m, m) matrix.
    input_term
        What R weighs: ``"rate"``, the change of u/u_max between samples; ``"normalised"``, u/u_max; ``"literal"``,
        u in newtons. u_max is the larger of the two input bounds in magnitude.
    input_bounds
        N; a pair of numbers or of m numbers each. (0, 10) is a robot whose cables only pull.
    output_bounds
        m; a pair of numbers or of p numbers each, or None.
    terminal
        ``"riccati"`` for V as above, None for no terminal cost.
    slack_weight
        Weight of a violated output bound, 1/m2.
    measurement_noise, input_noise, disturbance_noise
        Standard deviations that the Kalman filter assumes: of the sensor (m), of an unknown input that acts like a
        tension (N), and of the step that the output disturbance takes in a sample (m).
    backend
        QP solver: ``"daqp"``, ``"qpoases"`` or ``"osqp"``.

    Raises
    ------
    ValueError
        A setting is out of its range; the message names it and its value.
    """

    model: PredictionModel
    sample_time: float = 0.05
    horizon: int = 10
    Q: Weight = 1e3
    R: Weight = 1.0
    input_term: InputTerm = "rate"
    input_bounds: tuple = (-10.0, 10.0)
    output_bounds: tuple | None = (-0.1, 0.1)
    terminal: Literal["riccati"] | None = "riccati"
    slack_weight: float = 1e5
    measurement_noise: float = 1e-3
    input_noise: float = 0.5
    disturbance_noise: float = 1e-3
    backend: str = BACKENDS[0]

    def __post_init__(self) -> None:
        if not isinstance(self.model, PredictionModel):
            raise TypeError(f"model is a prediction-model family such as Modal(), not {self.model!r}")
        if not isinstance(self.horizon, Integral) or isinstance(self.horizon, bool) or self.horizon < 1:
            raise ValueError(f"horizon is a positive number of samples, not {self.horizon!r}")
        for name in ("sample_time", "slack_weight", "measurement_noise", "input_noise", "disturbance_noise"):
            value = getattr(self, name)
            if not (isinstance(value, int | float | np.number) and np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, not {value!r}")
        check_input_term(self.input_term)
        check_backend(self.backend)
        if self.terminal not in ("riccati", None):
            raise ValueError(f"terminal is 'riccati' or None, not {self.terminal!r}")
        weight_matrix(self.Q, self.outputs, "Q")
        if np.linalg.eigvalsh(weight_matrix(self.R, self.inputs, "R"))[0] <= 0:
            raise ValueError(f"R must be positive definite, not {self.R}: the input would be undetermined")
        bound_pair(self.input_bounds, self.inputs, "input_bounds")
        if self.output_bounds is not None:
            bound_pair(self.output_bounds, self.outputs, "output_bounds")
        for name in ("Q", "R", "input_bounds", "output_bounds"):
            object.__setattr__(self, name, hashable(getattr(self, name)))

    @property
    def inputs(self) -> int:
        """Number of tensions, m."""
        return self.model.inputs

    @property
    def outputs(self) -> int:
        """Number of outputs, p."""
        return self.model.axes

    @property
    def input_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the tensions, (m,) each, N."""
        return bound_pair(self.input_bounds, self.inputs, "input_bounds")

    @property
    def output_limits(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper bounds of the outputs, (p,) each, m; None without."""
        return None if self.output_bounds is None else bound_pair(self.output_bounds, self.outputs, "output_bounds")

    @property
    def input_scale(self) -> np.ndarray:
        """u_max (m,), N: the larger of the two bounds in magnitude."""
        return np.maximum(*np.abs(self.input_limits))

    def controller(self, theta: ArrayLike) -> "Controller":
        """The controller whose prediction model is that of ``theta``.

        Raises
        ------
        ValueError
            theta has another shape than (model.size,) or is not finite.
        DesignError
            The model gives no controller, for instance because it cannot be observed.
        """
        return self.controller_for(self.model.state_space(theta, self.sample_time))

    def controller_for(self, system: StateSpace) -> "Controller":
        """The controller on a given discrete-time model, of any order, at this sample time."""
        from ._controller import Controller

        return Controller(self, self.design(system))

    def design(self, system: StateSpace) -> Design:
        """Numbers of the controller on ``system``: observer gains, QP matrices, unconstrained law."""
        A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in system)
        n, m, p = len(A), self.inputs, self.outputs
        shapes = {"A": (A, (n, n)), "B": (B, (n, m)), "C": (C, (p, n)), "D": (D, (p, m))}
        for name, (matrix, shape) in shapes.items():
            if matrix.shape != shape:
                raise ValueError(
                    f"{name} has shape {matrix.shape}, but {shape} fits {n} states, {m} inputs, {p} outputs"
                )
        if not all(np.isfinite(matrix).all() for matrix in (A, B, C, D)):
            raise DesignError("the model gives no controller: its A, B, C or D is not finite")
        try:
            numbers = self.design_function(n).call([A, B, C, D])
        except RuntimeError as error:
            raise DesignError(
                "the model gives no controller: a matrix that the design inverts is singular "
                "(a pole at 1, inputs without any effect, or outputs without weight)"
            ) from error
        return Design.checked(numbers)

    @functools.lru_cache(maxsize=8)  # noqa: B019 (a specification is a small value; building its Function takes long)
    def design_function(self, order: int):
        """CasADi Function (A, B, C, D) of ``order`` states -> every number of the controller, see :class:`Design`."""
        return design_function(self, order)
