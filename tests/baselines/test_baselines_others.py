"""Robots on which a controller was not tuned."""

from dataclasses import replace

import numpy as np
import pytest
from baselines_support import rod_study

from socasadi import Rod, SimulatedPlant
from socasadi.baselines import DeadCable, Delayed, Loaded, Misrouted, Noisier, Rubbing, Softer
from socasadi.rod import Division, Material, Section, Strain


def test_robots_that_cannot_be_are_refused():
    plant = rod_study().plant
    for other, fault in (
        (Misrouted(1.2, cable=9), "no cable 9"),
        (DeadCable(3), "are 0 to 2"),
        (Delayed(-1), "not -1"),
    ):
        with pytest.raises(ValueError, match=fault):
            other(plant)


def test_other_robots_differ_in_what_they_say():
    made = rod_study()
    plant, tension = made.plant, np.array([6.0, 0.0, 0.0])

    def moved(robot, samples=60):
        robot.reset(seed=0)
        for _ in range(samples):
            robot.step(tension)
        return np.array(robot.true_output)

    own = moved(plant)
    still = moved(plant, 900)
    assert moved(Softer(young=0.8)(plant), 900)[0] == pytest.approx(still[0] / 0.8, rel=0.02)
    assert moved(Misrouted(1.2)(plant), 900)[0] == pytest.approx(1.2 * still[0], rel=0.02)
    assert moved(Rubbing(0.3)(plant), 900)[0] < still[0]
    np.testing.assert_allclose(moved(DeadCable(0)(plant)), 0, atol=1e-9)
    np.testing.assert_allclose(moved(Delayed(1)(plant), 61), own, atol=1e-12)
    assert moved(Loaded(0.1)(plant), 8)[0] < moved(plant, 8)[0]
    assert Noisier(3.0)(plant).noise == pytest.approx(3 * plant.noise)
    # Each division keeps what it is beside the others, and a stiffness that is given counts as the material's does.
    silicone, strain = Material(1e5, 0.5, 1000, damping=1e4), Strain(bending_y=1, bending_z=1)
    given = Division(0.3, Section.circle(0.03), silicone, strain, stiffness=(1, 0.06, 0.06, 1, 1, 1))
    stiff = Division(0.3, Section.circle(0.03), replace(silicone, young=1e6), strain, damping=lambda x: np.eye(6))
    rod = Rod(divisions=(given, stiff), cables=plant.rod.cables)
    soft = Softer(young=0.5, damping=2.0)(SimulatedPlant(rod)).rod
    assert [division.material.young for division in soft.divisions] == [0.5e5, 0.5e6]
    np.testing.assert_allclose(np.diag(soft.divisions[0].stiffness), np.array([1, 0.06, 0.06, 1, 1, 1]) / 2)
    np.testing.assert_allclose(soft.divisions[1].damping(0.3), 2 * np.eye(6))
    bent = rod.equilibrium(tension=[1, 0, 0]).tip[1]
    assert soft.equilibrium(tension=[0.5, 0, 0]).tip[1] == pytest.approx(bent, rel=1e-6)
    # Damping does not move where it comes to rest.
    np.testing.assert_allclose(moved(Softer(damping=1.2)(plant), 900), still, atol=1e-6)
    assert replace(made, plant=Delayed(1)(plant)).plant.outputs == 2
