from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..model import StateSpace
from ..mpc import LinearMPC


@dataclass(frozen=True, eq=False)
class ControllerRecord:
    """A controller as plain data, with the episode it is checked on and where it comes from.

    Parameters
    ----------
    mpc
        Its specification.
    system
        Its prediction model.
    output
        (T, p) m, measured at samples 0 ... T - 1 of an episode.
    preview
        (T, rows, p) m, what was wanted from each of these samples on; as many rows as the specification looks at.
    held
        (m,) N, tensions before the first sample.
    disturbance
        (T, k) measured disturbances; None for an MPC without.
    provenance
        Lines that go into the exported header: theta, cost, versions.
    """

    mpc: LinearMPC
    system: StateSpace
    output: np.ndarray
    preview: np.ndarray
    held: np.ndarray
    disturbance: np.ndarray | None = None
    provenance: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        mpc, T = self.mpc, len(self.output)
        if self.disturbance is None:
            object.__setattr__(self, "disturbance", np.zeros((T, 0)))
        shapes = {
            "output": (T, mpc.outputs),
            "preview": (T, mpc.reference_rows, mpc.outputs),
            "held": (mpc.inputs,),
            "disturbance": (T, mpc.measured_disturbances),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} of the recorded episode has shape {getattr(self, name).shape}, not {shape}")
        if not T:
            raise ValueError("the recorded episode is empty: there is nothing to check the controller on")

    @classmethod
    def simulated(cls, mpc: LinearMPC, system: StateSpace, *, samples: int = 200) -> "ControllerRecord":
        """The controller of a model that came from no campaign, with an episode in which it meets that model itself.

        The reference jumps every twenty samples to anywhere inside the output bounds, or as far as the inputs reach
        without them; the sensor is as noisy as the Kalman filter assumes.

        Raises
        ------
        DesignError
            The model gives no controller.
        """
        mpc = replace(mpc, backend="active-set")
        controller, random = mpc.controller_for(system), np.random.default_rng(0)
        design, held = controller.design, np.mean(mpc.input_limits, axis=0)
        controller.reset(held)
        v = held / mpc.input_scale
        x, w = design.rest @ v, np.zeros(mpc.measured_disturbances)
        noise = np.linalg.cholesky(mpc.noise.measurement)
        reach = np.abs(design.C @ design.rest + design.D) @ np.ones(mpc.inputs)
        if mpc.output_limits is not None:
            reach = np.minimum(reach, np.max(np.abs(mpc.output_limits), axis=0))
        output, preview = [], []
        for t in range(samples):
            if t % 20 == 0:
                wanted = np.tile(reach * random.uniform(-1, 1, mpc.outputs), (mpc.reference_rows, 1))
            y = design.C @ x + design.D @ v + noise @ random.normal(size=mpc.outputs)
            output.append(y)
            preview.append(wanted)
            v = controller.step(y, wanted, w if len(w) else None) / mpc.input_scale
            x = design.A @ x + design.B @ v
        told = (f"model of {len(system.A)} states, simulated on itself",)
        nothing = np.zeros((samples, len(w)))
        return cls(mpc, system, np.array(output), np.array(preview), held, nothing, provenance=told)

    def samples(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """What :meth:`Controller.step` was given at each sample: output, preview, measured disturbance."""
        assert self.disturbance is not None
        return zip(self.output, self.preview, self.disturbance, strict=True)

    def random_samples(
        self, count: int
    ) -> Iterator[tuple[np.ndarray | None, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        """Samples that mostly run into the bounds, the same at every call, and what is done before each.

        Yields tensions to rest under, from which the controller starts anew (every twentieth time) or None, and the
        arguments of :meth:`Controller.step`. Measurements wander, references jump; they and the measured disturbances
        are as large as the bounds allow or as they are in the episode, whichever is more.
        """
        random, mpc = np.random.default_rng(0), self.mpc
        output, wanted, disturbance = (
            max(np.abs(values).max(initial=0.0) for values in each) for each in zip(*self.samples(), strict=True)
        )
        if mpc.output_limits is not None:
            output = max(output, mpc.largest_output_bound)
        y, reference = np.zeros(mpc.outputs), np.zeros((mpc.reference_rows, mpc.outputs))
        for i in range(count):
            begins = i % 20 == 0
            held = random.uniform(*mpc.input_limits) if begins else None
            y = random.uniform(-output, output, mpc.outputs) if begins else 0.9 * y
            y = y + 0.3 * output * random.normal(size=mpc.outputs)
            if i % 5 == 0:
                # A preview that jumps at random, or a reference that stays.
                rows = mpc.reference_rows if i % 2 else 1
                reference = random.uniform(-1, 1, (rows, mpc.outputs)) * max(wanted, output)
                reference = np.resize(reference, (mpc.reference_rows, mpc.outputs))
            yield held, (y, reference, random.uniform(-disturbance, disturbance, mpc.measured_disturbances))
