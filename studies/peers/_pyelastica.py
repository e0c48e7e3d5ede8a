"""PyElastica: position Verlet, with one of two dampers.

Its own damper, "linear", brakes velocities, not strain rates; at the decay rate of the first bending mode it ends
0.6 mm away. "kelvin-voigt" is a damper of ours for bending and torsion, implicit because an explicit one would need
steps of 14 us at 20 elements. The rod is clamped at the centre of its first element, whose direction OneEndFixedBC
holds: with the clamp at that element's end, as is usual, the rod converges with first order only (1.0 mm off at 20
elements).
"""

import time
from importlib.metadata import version
from typing import Any

import numpy as np

from .case import COUPLE, DENSITY, LENGTH, RADIUS, TIMES, VEI, VGJ, VISCOSITY, YOUNG, Run, steps_a_sample


def pyelastica(elements: int = 12, step: float = 1e-3, damping: str = "kelvin-voigt") -> Run:
    """Position Verlet, shear factor set to one; `damping` is kelvin-voigt (ours) or linear (its own)."""
    import elastica  # pyright: ignore[reportMissingImports]

    class KelvinVoigt(elastica.DamperBase):
        """Implicit Euler for inertia d(omega)/dt = viscous second difference of omega: clamped, then free."""

        def __init__(self, time_step: float, **keywords: Any) -> None:
            super().__init__(**keywords)
            difference = np.eye(elements - 1) - np.eye(elements - 1, k=-1)  # the first element is held
            viscous = np.array([VEI, VEI, VGJ])  # its third axis is the rod's
            inertia = np.diagonal(self.system.mass_second_moment_of_inertia)[1:].T
            ratio = time_step * viscous[:, None] / self.system.rest_lengths[0] / inertia
            self.decay = np.linalg.inv(np.eye(elements - 1) + ratio[:, :, None] * (difference.T @ difference))

        def dampen_rates(self, system: Any, time: float) -> None:
            system.omega_collection[:, 1:] = (self.decay @ system.omega_collection[:, 1:, None])[:, :, 0]

    class TipCouple(elastica.NoForces):
        def apply_torques(self, system: Any, time: float = 0.0) -> None:
            system.external_torques[:, -1] += COUPLE * system.director_collection[:, 2, -1]

    class System(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping):
        pass

    def simulate(samples: int) -> tuple[np.ndarray, float, float]:
        begin = time.perf_counter()
        system, length = System(), LENGTH / (elements - 0.5)
        start, ahead, up = np.array([-length / 2, 0, 0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
        shape, elastic = (length * elements, RADIUS), {"youngs_modulus": YOUNG, "shear_modulus": YOUNG / 3}
        rod = elastica.CosseratRod.straight_rod(elements, start, ahead, up, *shape, DENSITY, **elastic)
        rod.shear_matrix[:2] *= 28 / 27
        system.append(rod)
        clamp = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
        system.constrain(rod).using(elastica.OneEndFixedBC, **clamp)
        system.add_forcing_to(rod).using(TipCouple)
        if damping == "linear":
            decay = 3 * VISCOSITY / YOUNG * (2 * np.pi * 0.7331) ** 2  # of velocity, first mode at 0.7331 Hz
            system.dampen(rod).using(elastica.AnalyticalLinearDamper, uniform_damping_constant=decay, time_step=step)
        else:
            system.dampen(rod).using(KelvinVoigt, time_step=step)
        system.finalize()
        stepper, now, tip = elastica.PositionVerlet(), 0.0, []
        begun = time.perf_counter()
        for _ in range(samples):
            for _ in range(steps_a_sample(step)):
                now = stepper.step(system, now, step)
            tip.append(rod.position_collection[:, -1].copy())
        return np.array(tip), time.perf_counter() - begun, begun - begin

    begin = time.perf_counter()
    simulate(1)
    warm = time.perf_counter() - begin
    runs = [simulate(len(TIMES)) for _ in range(3)]
    name = f"PyElastica {version('pyelastica')}, {damping} damper, {elements} elements, {1e3 * step:.3g} ms"
    wall, setup = min(run[1] for run in runs), warm + runs[0][2]
    return Run(name, True, 6 * (elements - 1) + 3, TIMES, runs[0][0], wall, setup)
