"""The controller inside a campaign: compiled, told of disturbances, on a microcontroller."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.campaign import assess, emulate, fly
from socasadi.codegen import c_compiler
from socasadi.export import build_and_replay, toolchain
from socasadi.mpc import CompiledController

with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")


def windy(plant):
    """The same plant in a wind that is measured and moves y."""

    class Windy(type(plant)):
        def reset(self, tip=None, **settings):
            self.time = 0
            return super().reset(tip, **settings)

        def step(self, tension, tip_force=None):
            self.y = self.y + np.array([0.2 * 0.02 * self.disturbance[0], 0.0])
            self.time += 1
            return super().step(tension, tip_force)

        @property
        def disturbance(self):
            return np.array([1.0 if (self.time // 6) % 2 else -1.0])

    return Windy(noise=1e-4)


TOLD = LinearMPC(Modal(inputs=4), measured_disturbances=1)
ARM = {"length": 0.6, "bending_stiffness": 0.64, "mass_per_length": 2.8, "cable_offset": 0.02}
# Lags as slow oscillators, damped, whose gains are those of the plant.
GAINS = 0.005 * np.array([[1.0, -0.5, -0.5], [0.0, 0.87, -0.87]])


@with_compiler
def test_trials_fly_with_the_very_c_that_is_exported(toy_study):
    theta = [(entry.lower + entry.upper) / 2 for entry in Modal.from_spec(**ARM).entries]
    assert isinstance(toy_study.mpc.controller(theta), CompiledController)


def test_a_controller_that_is_told_of_the_wind_does_better_than_one_that_is_not(toy_study):
    plant = windy(toy_study.plant)
    theta = lambda wind: np.array([9.0, 0.7, *GAINS[0], *wind[:1], 9.0, 0.7, *GAINS[1], *wind[1:]])  # noqa: E731
    told = TOLD.controller(theta([0.02, 0.0]))
    blind = LinearMPC(Modal()).controller(theta([]))
    errors = []
    for controller in (told, blind):
        episode = fly(plant, controller, replace(toy_study.task, duration=4.0), seed=0, time_limit=60)
        assert episode.failure is None
        errors.append(np.sqrt(np.mean((episode.truth - episode.reference)[20:, 0] ** 2)))
        assert episode.disturbance.shape == (80, controller.mpc.measured_disturbances)
    assert errors[0] < 0.8 * errors[1]


def test_a_campaign_with_a_measured_disturbance_runs_and_is_exported(toy_study, tmp_path):
    study = replace(toy_study, plant=windy(toy_study.plant), mpc=TOLD)
    result = study.run(tmp_path / "run", progress=None)
    assert result.episode(result.best.number).disturbance.shape == (20, 1)
    assert "does not hold the disturbances that are measured" in (assess(result).unidentified or "")
    if c_compiler():
        result.export(tmp_path / "c")
        assert "0 clipped, 0 held" in build_and_replay(tmp_path / "c")


def test_a_plant_that_does_not_measure_what_the_mpc_asks_for_is_refused(toy_study):
    with pytest.raises(ValueError, match="has 1 measured disturbances, but the plant has no `disturbance`"):
        replace(toy_study, mpc=TOLD)


@with_compiler
@pytest.mark.skipif(toolchain() is not None, reason=f"no emulated microcontroller: {toolchain()}")
@pytest.mark.parametrize("real", ["float", "double"])
def test_the_processor_in_the_loop_flies_what_the_same_c_flies_here(toy_study, tmp_path, real):
    flown = emulate(toy_study.run(tmp_path / "run", progress=None), real=real)
    assert flown.difference == 0
    assert flown.episode.failure is None
    assert (tmp_path / "run" / f"microcontroller-{real}.json").exists()
