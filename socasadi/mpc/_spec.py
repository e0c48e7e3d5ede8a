import functools
from dataclasses import dataclass, fields
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..codegen import c_compiler, warn_interpreted
from ..model import Entry, PredictionModel, StateSpace
from ._check import check_settings
from ._compiled import CompiledController
from ._controller import Controller
from ._interpreted import InterpretedController
from ._tables import Real, check_real
from ._tuned import factors, settled, tuned_entries
from .formulation import (
    NUMBERS,
    SINGULAR,
    Design,
    DesignError,
    InputTerm,
    Noise,
    Weight,
    block_lengths,
    bound_pair,
    covariance,
    design_function,
    hashable,
)

_INTERPRETED = "daqp"
"""The back end that stands in for "active-set" where there is no C compiler."""


@dataclass(frozen=True)
class LinearMPC:
    r"""A constrained linear MPC in which only the prediction model is open.

    At every sample it estimates state and disturbance with a Kalman filter and solves

    .. math::
        \min_{u, s}\; \sum_{k=1}^{N} |y_k - r_k|_Q^2 + \sum_{k=0}^{N-1} \left( \rho_R(u_k)
            + |\Delta u_k / u_{max}|_{R_\Delta}^2 \right) + V(x_N - x_s, u_{N-1} - u_s)
            + \sum_k (\lambda |s_k|^2 + \mu |s_k|_1)

    subject to :math:`u_{min} \le u_k \le u_{max}` and :math:`\dot u_{min} T \le \Delta u_k \le \dot u_{max} T` (hard)
    and :math:`y_{min} - s_k \le y_k \le y_{max} + s_k`, :math:`s_k \ge 0` (soft). :math:`\rho_R` is the chosen input
    term, V the cost-to-go of the unconstrained problem, and :math:`(x_s, u_s)` the best steady state for the last
    reference under the estimated disturbance.

    Parameters
    ----------
    model
        Family of prediction models; theta picks one. Of a model given as it is, to :meth:`controller_for`, it says how
        many outputs and inputs there are. A pole at 1 is refused: the controller needs to know where the model rests.
    sample_time
        s.
    horizon
        N, samples.
    control_horizon
        How many of the N inputs are free, the last of them held to the end of the horizon; or the lengths, in samples,
        of the blocks over which each is held ("move blocking"), which add up to N; None: all.
    preview
        Rows of the reference that are looked at; the last is held to the end of the horizon. None: N.
    Q
        Weight of the outputs, 1/m2: a number, p numbers or a (p, p) matrix.
    R
        Weight of the input term: a positive number, m positive numbers or a positive definite (m, m) matrix.
    input_term
        What R weighs: ``"rate"``, the change of u/u_max between samples; ``"normalised"``, u/u_max; ``"literal"``,
        u in newtons. u_max is the larger of the two input bounds in magnitude. With ``"rate"`` a ten-thousandth of R
        holds, near the middle of the bounds, what the outputs at rest do not see of the input.
    rate_weight
        :math:`R_\Delta`, weight of the change of u/u_max between samples beside R's term, in the forms of R; may be 0.
    input_bounds
        N; a pair of numbers or of m numbers each. (0, 10) is a robot whose cables only pull.
    rate_bounds
        N/s; a pair of numbers or of m numbers each with 0 between them, infinite where there is no bound; or None.
    output_bounds
        m; a pair of numbers or of p numbers each, infinite where there is no bound; or None. A measurement beyond
        10,000 times the largest of them is taken for a fault of the sensor, and corrects nothing.
    terminal
        ``"riccati"`` for V as above, None for no terminal cost.
    slack_weight
        :math:`\lambda`, quadratic weight of a violated output bound, 1/m2: a positive number or p of them.
    slack_linear
        :math:`\mu`, linear weight of a violated output bound, 1/m: a number or p of them, not negative. Where it is
        larger than what the bound is worth, the bound is kept whenever it can be.
    measurement_noise, input_noise, disturbance_noise
        What the Kalman filter assumes: of the sensor (m), of an unknown input that acts like a tension (N), and of the
        step that the disturbance takes in a sample (m). Each a standard deviation, one per channel, or a covariance
        matrix.
    disturbance_model
        Where the estimated constant disturbance enters: ``"output"``, at the outputs; ``"input"``, at the inputs,
        through the right inverse of the static gain, so that it is counted in metres of output at rest too. Either
        leaves no steady error.
    measured_disturbances
        How many of the model's inputs, the last ones, are not tensions but disturbances that are measured.
    delay
        Samples after which a tension begins to act beyond the model's own dynamics. Measured disturbances are not
        delayed.
    backend
        QP solver: ``"active-set"``, the project's own, compiled; ``"daqp"``, ``"qpoases"`` or ``"osqp"``.
    iteration_limit
        Changes of the working set after which ``"active-set"`` gives up; it then tries once more from nothing, unless
        it has, before the clipped unconstrained law is applied. This bounds the time of a step. None: 50, and two more
        a constraint.
    tuned
        Settings that theta holds beside the model, each as a factor on what is given here: names among ``"Q"``,
        ``"R"``, ``"rate_weight"``, ``"slack_weight"``, ``"measurement_noise"``, ``"input_noise"`` and
        ``"disturbance_noise"``, searched from 0.01 to 100; or a mapping of names to the least and the largest factor.
        Of the three kinds of noise only the quotients matter, and of Q and R.

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
    slack_weight: float | tuple[float, ...] = 1e5
    measurement_noise: Weight = 1e-3
    input_noise: Weight = 0.5
    disturbance_noise: Weight = 1e-3
    backend: str = "active-set"
    control_horizon: int | tuple[int, ...] | None = None
    preview: int | None = None
    rate_weight: Weight = 0.0
    rate_bounds: tuple | None = None
    slack_linear: float | tuple[float, ...] = 0.0
    disturbance_model: Literal["output", "input"] = "output"
    measured_disturbances: int = 0
    delay: int = 0
    iteration_limit: int | None = None
    tuned: Any = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "tuned", tuned_entries(self.tuned))
        check_settings(self)
        for field in fields(self):
            if field.name != "model":
                object.__setattr__(self, field.name, hashable(getattr(self, field.name)))

    @property
    def inputs(self) -> int:
        """Number of tensions, m."""
        return self.model.inputs - self.measured_disturbances

    @property
    def outputs(self) -> int:
        """Number of outputs, p."""
        return self.model.axes

    @functools.cached_property
    def entries(self) -> tuple[Entry, ...]:
        """The entries of theta: those of the prediction model, and a factor for each of ``tuned``."""
        return (*self.model.entries, *factors(self))

    @property
    def size(self) -> int:
        """Number of entries of theta."""
        return len(self.entries)

    def check(self, theta: ArrayLike) -> np.ndarray:
        """``theta`` as floats (size,).

        Raises
        ------
        ValueError
            Its shape is another, an entry is not finite, or a factor is not positive.
        """
        values = np.asarray(theta, dtype=float)
        if not self.tuned:
            return self.model.check(values)
        if values.shape != (self.size,):
            raise ValueError(
                f"theta has shape {values.shape}; this MPC takes ({self.size},): {self.model.size} of its "
                f"{type(self.model).__name__} and {len(self.tuned)} factors"
            )
        self.model.check(values[: self.model.size])
        for entry, value in zip(self.entries[self.model.size :], values[self.model.size :], strict=True):
            if not 0 < value < np.inf:
                raise ValueError(f"{entry.name} is a factor, not {value}")
        return values

    def at(self, theta: ArrayLike) -> "LinearMPC":
        """The MPC with the settings of ``theta``, of which nothing but the model is left open."""
        return settled(self, self.check(theta)[self.model.size :])

    def system(self, theta: ArrayLike) -> StateSpace:
        """The prediction model of ``theta``."""
        return self.model.state_space(self.check(theta)[: self.model.size], self.sample_time)

    def whole(self, theta: ArrayLike) -> np.ndarray:
        """theta (size,) of the model's own (model.size,): the settings as they are here, or the nearest they may be."""
        ones = [min(max(1.0, lower), upper) for _, lower, upper in self.tuned]
        return np.concatenate([self.model.check(theta), ones])

    @property
    def blocks(self) -> tuple[int, ...]:
        """Samples over which each free input is held; they add up to the horizon."""
        return block_lengths(self.control_horizon, self.horizon)

    @property
    def reference_rows(self) -> int:
        """Rows of the reference that are looked at."""
        return self.horizon if self.preview is None else self.preview

    @property
    def input_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the tensions, (m,) each, N."""
        return bound_pair(self.input_bounds, self.inputs, "input_bounds")

    @property
    def rate_limits(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper bounds of the tensions' rates, (m,) each, N/s; None without."""
        if self.rate_bounds is None:
            return None
        lower, upper = bound_pair(self.rate_bounds, self.inputs, "rate_bounds", infinite=True)
        if (lower > 0).any() or (upper < 0).any():
            raise ValueError(f"rate_bounds must have 0 between them, not {self.rate_bounds}: a tension may be held")
        return lower, upper

    @property
    def output_limits(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper bounds of the outputs, (p,) each, m; None without."""
        if self.output_bounds is None:
            return None
        lower, upper = bound_pair(self.output_bounds, self.outputs, "output_bounds", infinite=True)
        if not np.isfinite([lower, upper]).any():
            raise ValueError(f"output_bounds {self.output_bounds} bound nothing: give None")
        return lower, upper

    @property
    def largest_output_bound(self) -> float:
        """The largest magnitude among the output bounds, m; infinite without."""
        if self.output_limits is None:
            return np.inf
        magnitudes = np.abs(self.output_limits)
        # Bounds at zero alone say nothing of the size; a metre is as good as any.
        return float(magnitudes[np.isfinite(magnitudes)].max()) or 1.0

    @property
    def plausible_output(self) -> float:
        """Magnitude from which on a measurement is taken for a fault of the sensor, m."""
        return min(1e4 * self.largest_output_bound, 1e15)

    @property
    def input_scale(self) -> np.ndarray:
        """u_max (m,), N: the larger of the two bounds in magnitude."""
        return np.maximum(*np.abs(self.input_limits))

    @property
    def noise(self) -> Noise:
        """Covariances that the Kalman filter assumes."""
        return Noise(
            input=covariance(self.input_noise, self.inputs, "input_noise"),
            disturbance=covariance(self.disturbance_noise, self.outputs, "disturbance_noise"),
            measurement=covariance(self.measurement_noise, self.outputs, "measurement_noise", definite=True),
        )

    def controller(self, theta: ArrayLike, *, real: Real = "double") -> Controller:
        """The controller whose prediction model is that of ``theta``.

        Parameters
        ----------
        theta
            (size,).
        real
            What it computes in, ``"double"`` or, of the back end ``"active-set"`` only, ``"float"``.

        Raises
        ------
        ValueError
            theta has another shape or is not finite, or ``real`` does not fit the back end.
        DesignError
            The model gives no controller, for instance because it cannot be observed.
        """
        return self.at(theta).controller_for(self.system(theta), real=real)

    def controller_for(self, system: StateSpace, *, real: Real = "double") -> Controller:
        """The controller on a given discrete-time model of any order, sampled as this MPC is.

        Parameters
        ----------
        system
            A (n, n), B (n, m + k), C (p, n) and D (p, m + k): columns of B and D are the m tensions, N, and then the k
            measured disturbances.
        real
            As in :meth:`controller`.

        Raises
        ------
        ValueError
            A shape does not fit.
        DesignError
            The model gives no controller.
        """
        check_real(real)
        design = self.design(system)
        if self.backend == "active-set" and c_compiler() is not None:
            return CompiledController(self, design, real)
        if real != "double":
            raise ValueError(f"real={real!r} takes the back end 'active-set' and a C compiler")
        if self.backend == "active-set":
            warn_interpreted()
            return InterpretedController(self, design, _INTERPRETED)
        return InterpretedController(self, design, self.backend)

    def design(self, system: StateSpace) -> Design:
        """Numbers of the controller on ``system``: observer gains, QP matrices, unconstrained law."""
        A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in system)
        n, m, p = len(A), self.model.inputs, self.outputs
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
            raise DesignError(f"the model gives no controller: {SINGULAR}") from error
        return Design.checked(numbers)

    @functools.lru_cache(maxsize=8)  # noqa: B019 (a specification is a small value; building its Function takes long)
    def design_function(self, order: int):
        """CasADi Function (A, B, C, D) of ``order`` states -> every number of the controller, see :class:`Design`."""
        return design_function(self, order)

    @property
    def formulation(self) -> ca.Function:
        """CasADi Function theta (size,) -> every number of the controller by its name in :class:`Design`.

        Behind them comes the largest relative residual of the Riccati equations. It is differentiable in theta; the
        numbers are a controller's only where :meth:`controller` accepts theta.

        Raises
        ------
        ValueError
            Settings are ``tuned``: they are no symbols in it.
        """
        if self.tuned:
            raise ValueError("the formulation is one of the model alone: take that of mpc.at(theta)")
        return _formulation(self)


@functools.lru_cache(maxsize=8)
def _formulation(mpc: LinearMPC) -> ca.Function:
    theta = ca.MX.sym("theta", mpc.model.size)  # pyright: ignore
    numbers = mpc.design_function(mpc.model.order)(*mpc.model.matrices(mpc.sample_time)(theta))
    return ca.Function("formulation", [theta], list(numbers), ["theta"], [*NUMBERS, "residual"])
