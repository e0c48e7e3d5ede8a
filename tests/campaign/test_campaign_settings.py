"""A run folder says what was run, whatever the robot is made of."""

import json
from dataclasses import replace

import casadi as ca
import pytest

from socasadi import Circle, Cost, LinearMPC, Modal, SimulatedPlant, Study
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
