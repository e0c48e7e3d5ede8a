"""The robots of which something is known: a rod, a linear model, or where the one rests and how the other moves."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ..campaign import Study
from ..model import PredictionModel, Record, StateSpace, identify, prediction_error
from ..plant import SimulatedPlant
from ..rod import EquilibriumError
from ._reach import nearest
from ._robot import Pose, Robot


def known(study: Study, plant: SimulatedPlant | None, record: Record | None) -> tuple[Robot | None, float | None]:
    """What is known of the robot, and the standard deviation of its sensor's noise."""
    mpc = study.mpc
    rod = None if plant is None else RodRobot(plant) if plant is study.plant else RodRobot(plant, "the data sheet")
    if record is not None:
        theta = identify(mpc.model, record, within_bounds=False)
        noise = _noise(record, prediction_error(mpc.model, theta, record))
        moves = LinearRobot(mpc.model, theta, mpc.sample_time, mpc.inputs, "the probing record")
        return (moves if rod is None else ProbedRobot(rod, moves)), noise
    if plant is not None:
        return rod, plant.noise
    theta = np.array(
        [
            np.sqrt(entry.lower * entry.upper) if entry.scale == "log" else (entry.lower + entry.upper) / 2
            for entry in mpc.model.entries
        ]
    )
    try:
        robot = LinearRobot(mpc.model, theta, mpc.sample_time, mpc.inputs, "the middle of theta's bounds")
    except np.linalg.LinAlgError:  # a model that does not come to rest
        return None, None
    widths = [entry.upper - entry.lower for entry in mpc.model.entries if entry.scale == "linear"]
    tells = np.abs(robot.pose(np.zeros(mpc.inputs)).slope).max() > 0.05 * max(widths, default=0.0)
    return (robot if tells else None), None


def _noise(record: Record, error: float) -> float:
    """Standard deviation of a channel: the third differences, which a smooth motion has not, or the fit's error."""
    outputs = record.output.shape[1]
    rough = float(np.sqrt(np.mean(np.diff(record.output, n=3, axis=0) ** 2) / 20))
    return min(rough, error / np.sqrt(outputs))


class RodRobot:
    """A rod of which everything is known."""

    def __init__(self, plant: SimulatedPlant, source: str = "the rod") -> None:
        self.plant, self.rod, self.source = plant, plant.rod.valued, source

    @property
    def neutral(self) -> np.ndarray:
        return self.rod.neutral

    @property
    def mass(self) -> float:
        """Of the rod without payloads, kg, by Simpson's rule in each division."""
        return sum(
            float(ca.DM(d.length / 6 * (d.inertia_at(0.0)[3] + 4 * d.inertia_at(0.5)[3] + d.inertia_at(1.0)[3])))
            for d in self.rod.divisions
        )

    def pose(self, given: np.ndarray, near: Pose | None = None) -> Pose:
        found = self.rod.equilibrium(given, near=near and near.equilibrium)
        output, slope = (value.full() for value in self._seen(found.q))
        by_input = slope @ np.linalg.solve(found.stiffness, self._force(found.q, given).full())
        return Pose(np.asarray(given, dtype=float), output[:, 0], by_input, found)

    def released(self, tip: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> Pose:
        return self.pose(self.rod.equilibrium_at(tip, bounds).input)

    def linear(self, pose: Pose) -> StateSpace:
        return StateSpace(*self.rod.linearise(pose.equilibrium, self.plant.sample_time, self.plant.sensor))

    def slowest(self, pose: Pose) -> tuple[float, float]:
        modes = self.rod.modes(pose.equilibrium)
        return float(modes.frequency[0]), float(modes.damping_ratio[0])

    @cached_property
    def _seen(self) -> ca.Function:
        """q -> (output, its Jacobian)"""
        q = ca.MX.sym("q", self.rod.dof)  # pyright: ignore[reportArgumentType]
        y = self.plant.sensor(ca.vertcat(q, ca.DM.zeros(self.rod.dof)))
        return ca.Function("seen", [q], [y, ca.jacobian(y, q)])

    @cached_property
    def _force(self) -> ca.Function:
        """(q, input) -> derivative of the generalised force with respect to the inputs"""
        q, u = ca.MX.sym("q", self.rod.dof), ca.MX.sym("u", len(self.rod.cables))  # pyright: ignore
        force = self.rod.actuation(q) @ self.rod.model.tensions(q, u)
        return ca.Function("force", [q, u], [ca.jacobian(force, u)])


class LinearRobot:
    """A robot of which a linear model is known, so that any pose is like any other."""

    def __init__(self, model: PredictionModel, theta: np.ndarray, sample_time: float, inputs: int, source: str) -> None:
        self.source = source
        A, B, C, D = model.state_space(theta, sample_time)
        self._system, self._sample_time = StateSpace(A, B[:, :inputs], C, D[:, :inputs]), sample_time
        # What is measured at rest is where its outputs are counted from.
        self._gain = C @ np.linalg.solve(np.eye(len(A)) - A, B[:, :inputs]) + D[:, :inputs]

    @property
    def neutral(self) -> np.ndarray:
        return np.zeros(self._gain.shape[1])

    def pose(self, given: np.ndarray, near: Pose | None = None) -> Pose:
        return Pose(np.asarray(given, dtype=float), self._gain @ given, self._gain)

    def released(self, tip: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> Pose:
        found = nearest(self, tip, bounds, self.pose(np.clip(self.neutral, *bounds)))
        if (missed := float(np.linalg.norm(found.output - tip))) > 0.01 * float(np.linalg.norm(tip)):
            raise EquilibriumError(f"the tip cannot be held at {tip.tolist()} m: the nearest is {missed:.3g} m away")
        return found

    def linear(self, pose: Pose) -> StateSpace:
        return self._system

    def slowest(self, pose: Pose) -> tuple[float, float]:
        poles = np.linalg.eigvals(self._system.A).astype(complex)
        lasting = poles[np.abs(poles) > 1e-6]  # a pole at zero is a delay
        continuous = np.log(lasting if len(lasting) else np.array([1e-6 + 0j])) / self._sample_time
        slowest = continuous[np.abs(continuous).argmin()]
        return float(np.abs(slowest) / (2 * np.pi)), float(-slowest.real / np.abs(slowest))


@dataclass(frozen=True, eq=False)
class ProbedRobot:
    """A robot of two sources: where it comes to rest is known from one, how it moves from the other."""

    statics: Robot
    dynamics: Robot

    @property
    def source(self) -> str:
        return f"{self.statics.source} and {self.dynamics.source}"

    @property
    def neutral(self) -> np.ndarray:
        return self.statics.neutral

    def pose(self, given: np.ndarray, near: Pose | None = None) -> Pose:
        return self.statics.pose(given, near)

    def released(self, tip: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> Pose:
        return self.statics.released(tip, bounds)

    def linear(self, pose: Pose) -> StateSpace:
        return self.dynamics.linear(pose)

    def slowest(self, pose: Pose) -> tuple[float, float]:
        return self.dynamics.slowest(pose)
