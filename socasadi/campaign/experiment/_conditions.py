"""Conditions on a controller that are computed before any experiment with it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from numbers import Integral, Real
from typing import Protocol, runtime_checkable

import numpy as np

from ...export import ControllerRecord
from ...mpc import CompiledController, DesignError, LinearMPC
from ...mpc.analysis import loop_radius


@runtime_checkable
class Condition(Protocol):
    """What a theta has to meet to be tried at all: a frozen dataclass.

    One that asks something of the MPC may have ``check(mpc)``, which raises ValueError.
    """

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    def margin(self, mpc: LinearMPC, theta: np.ndarray) -> float:
        """How well it is met; it holds from 0 on. The same for the same theta; DesignError counts as -infinity."""
        ...


@dataclass(frozen=True)
class ClosedLoopStability:
    """The loop around theta's own model is stable, and stays so when the robot's gain is another than the model's.

    While no bound is active. The margin is ``radius`` less the largest spectral radius of the loop as the gain goes
    from the model's over ``gain_margin`` to the model's times ``gain_margin``, in five equal ratios.

    Parameters
    ----------
    gain_margin
        Factor, at least 1, by which the gain may be off either way. With all moves free and a Riccati terminal cost the
        loop on the model itself is stable whatever theta is, and bears a factor of 2 to 3.
    radius
        Largest spectral radius, below 1: a mode at 0.999 and 50 ms takes 50 s to fall to a third.
    """

    gain_margin: float = 2.0
    radius: float = 0.999

    def __post_init__(self) -> None:
        if not (isinstance(self.gain_margin, Real) and isfinite(self.gain_margin) and self.gain_margin >= 1):
            raise ValueError(f"gain_margin is a factor of at least 1, not {self.gain_margin!r}")
        if not (isinstance(self.radius, Real) and 0 < self.radius < 1):
            raise ValueError(f"radius of ClosedLoopStability lies between 0 and 1, not at {self.radius!r}")

    @property
    def name(self) -> str:
        return "closed_loop_stability"

    def margin(self, mpc: LinearMPC, theta: np.ndarray) -> float:
        mpc, system = mpc.at(theta), mpc.system(theta)
        design = mpc.design(system)
        factors = self.gain_margin ** np.linspace(-1, 1, 5 if self.gain_margin > 1 else 1)
        return self.radius - max(loop_radius(mpc, design, factor) for factor in factors)


@dataclass(frozen=True)
class IterationBound:
    """The QP solver needs no more than ``limit`` iterations in any of a fixed set of random samples.

    The samples mostly run into the bounds, as the controller's test on a microcontroller has them; they are no proof
    for all samples (``iteration_limit`` of the MPC is what bounds the time of a step).

    Parameters
    ----------
    limit
        Iterations, changes of the working set.
    samples
        How many.
    """

    limit: int
    samples: int = 200

    def __post_init__(self) -> None:
        for name in ("limit", "samples"):
            if not isinstance(value := getattr(self, name), Integral) or value < 1:
                raise ValueError(f"{name} of IterationBound is a positive integer, not {value!r}")

    @property
    def name(self) -> str:
        return "iteration_bound"

    def check(self, mpc: LinearMPC) -> None:
        """ValueError when the MPC's solver does not count its iterations."""
        if mpc.backend != "active-set":
            raise ValueError(f"IterationBound counts iterations of the back end 'active-set', not of {mpc.backend!r}")

    def margin(self, mpc: LinearMPC, theta: np.ndarray) -> float:
        mpc, system = mpc.at(theta), mpc.system(theta)
        record = ControllerRecord.simulated(mpc, system, samples=1)
        controller, worst = mpc.controller_for(system), 0
        if not isinstance(controller, CompiledController):
            raise ValueError("IterationBound counts iterations of the compiled controller, and there is no C compiler")
        for held, sample in record.random_samples(self.samples):
            if held is not None:  # which forgets the counts, too
                worst = max(worst, controller.info.worst_iterations)
                controller.reset(held)
            controller.step(*sample)
        return float(self.limit - max(worst, controller.info.worst_iterations))


def check_conditions(conditions: Sequence[Condition], mpc: LinearMPC) -> None:
    """TypeError or ValueError when these are no conditions of a study with that MPC."""
    if not isinstance(conditions, tuple | list):
        raise TypeError(f"conditions of a study are a tuple, such as (ClosedLoopStability(),), not {conditions!r}")
    names = []
    for condition in conditions:
        if isinstance(condition, type) or not isinstance(condition, Condition):
            raise TypeError(f"a condition has name and margin, such as ClosedLoopStability(); {condition!r} has not")
        if condition.name in names:
            raise ValueError(f"two conditions of the study are called {condition.name!r}; names tell them apart")
        names.append(condition.name)
        if check := getattr(condition, "check", None):
            check(mpc)


def admissible(conditions: Sequence[Condition], mpc: LinearMPC) -> Callable[[np.ndarray], bool] | None:
    """Whether a theta meets all conditions, as a function for the search; None without conditions."""
    if not conditions:
        return None
    return lambda theta: all(_margin(condition, mpc, theta) >= 0 for condition in conditions)


def _margin(condition: Condition, mpc: LinearMPC, theta: np.ndarray) -> float:
    try:
        return condition.margin(mpc, theta)
    except DesignError:
        return -inf
