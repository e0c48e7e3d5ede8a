"""A run folder says what was run, whatever the robot is made of."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from socasadi import Circle, Cost, LinearMPC, Modal, SimulatedPlant, Study
from socasadi.campaign.store import describe
from socasadi.plant import ExternalPlantError
from socasadi.rod import BSpline, Cable, Helix, Payload, Rod, Strain, Taper

ROD = Rod.preset("paper")


def study(rod):
    return Study(plant=SimulatedPlant(rod), mpc=LinearMPC(Modal()), task=Circle(), cost=Cost())


def stored(rod):
    return json.loads(json.dumps(study(rod).settings))


def test_a_rod_of_many_parts_comes_back_from_its_settings():
    rod = replace(
        ROD,
        cables=(Cable(Helix(radius=0.02, pitch=0.3), friction=0.1), *ROD.cables[1:]),
        payloads=(Payload(0.05, offset=(0.02, 0, 0)),),
        strain=Strain(bending_y=2, bending_z=BSpline(1, 3)),
        section=Taper("circle", 0.03, 0.02),
    )
    assert Study.from_settings(stored(rod)).plant.rod == rod


def test_a_route_of_ones_own_is_told_from_others_and_cannot_be_flown_from_the_folder():
    def wavy(value):
        return stored(replace(ROD, cables=(Cable(lambda s: (value * ca.cos(s), 0.0)), *ROD.cables[1:])))

    settings = wavy(0.01)
    assert settings == wavy(0.01)
    assert settings != wavy(0.015)
    assert settings != stored(replace(ROD, cables=(Cable(lambda s: (0.01 * ca.sin(s), 0.0)), *ROD.cables[1:])))
    with pytest.raises(ExternalPlantError, match="SimulatedPlant cannot be flown from here"):
        Study.from_settings(settings).plant.reset()


def test_parameters_with_values_are_part_of_the_settings():
    E = ca.SX.sym("E")
    soft = replace(ROD, material=replace(ROD.divisions[0].material, young=2 * E), parameters=(E,))
    settings = stored(soft.at([5e5]))  # a rod of numbers
    assert settings["plant"]["rod"]["divisions"][0]["material"]["young"] == 1e6
    assert Study.from_settings(settings).plant.rod == soft.at([5e5])


def told_from(first, second):
    return describe(first) != describe(second)


def test_a_function_is_told_from_others_by_all_that_it_uses():
    def made(k, table):
        def helper(x):
            return k * x

        return lambda episode, mpc, at=3: helper(at) + table.sum()

    known = made(1, np.arange(3))
    assert not told_from(known, made(1, np.arange(3)))
    assert told_from(known, made(2, np.arange(3)))
    assert told_from(known, made(1, np.arange(4)))
    assert told_from(lambda x, at=1: x, lambda x, at=2: x)
    assert not told_from(np.max, np.max)
    assert "0x" not in str(describe(np.max))


def test_the_same_script_is_described_the_same_in_every_process():
    code = "from socasadi.campaign.store import describe; print(describe(lambda x: x in {'a', 'b', 'c', 'd'})['code'])"
    told = {
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(told) == 1
    assert told != {""}
