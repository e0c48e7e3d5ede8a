"""The step function: accuracy of whole runs, energy, stiff rods, what it shares with the reference integrators."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rod_support import rich_rod, values

from socasadi.rod import Drag, Material, Payload, Rod

PAPER = Rod.preset("paper")


def run(step, x, tension, samples, tip_force=(0.0, 0.0, 0.0)):
    states = [np.asarray(x, dtype=float)]
    for _ in range(samples):
        states.append(values(step, states[-1], tension, tip_force))
    return np.array(states)


def test_tip_one_second_after_a_step_of_tension():
    zero, tension = np.zeros(2 * PAPER.dof), [5.0, 0.0, 0.0]
    end = run(PAPER.step(0.05), zero, tension, 20)[-1]
    exact = values(PAPER.reference_step(1.0), zero, tension, np.zeros(3))
    tips = [values(PAPER.tip, x[: PAPER.dof]) for x in (end, exact)]
    assert np.linalg.norm(tips[0] - tips[1]) < 5e-6  # m; a tenth of what is asked of it


def test_tip_during_a_disturbance():
    zero, tension, pulse = np.zeros(2 * PAPER.dof), [5.0, -3.0, 0.0], [0.0, 0.0, 0.2]
    end = run(PAPER.step(0.05), zero, tension, 6, pulse)[-1]
    exact = values(PAPER.reference_step(0.3), zero, tension, pulse)
    tips = [values(PAPER.tip, x[: PAPER.dof]) for x in (end, exact)]
    assert np.linalg.norm(tips[0] - tips[1]) < 2e-5


def test_a_rod_with_everything_against_cvodes():
    rod = rich_rod()
    start, tension = rod.equilibrium([2.0, 1.0, 0.5, 1e3]).state, [0.0, 3.0, 0.0, 0.0]
    exact = values(rod.reference_step(0.2), start, tension, [0.0, 0.1, 0.0])
    ends = [values(rod.step_expression(0.2, h), start, tension, [0.0, 0.1, 0.0]) for h in (0.004, 0.002)]
    tips = [values(rod.tip, x[: rod.dof]) for x in (*ends, exact)]
    moved = np.linalg.norm(tips[2] - values(rod.tip, start[: rod.dof]))
    assert moved > 0.01
    assert np.linalg.norm(tips[1] - tips[2]) < 1e-3 * moved
    assert np.linalg.norm(tips[0] - tips[2]) / np.linalg.norm(tips[1] - tips[2]) > 3.5  # order two at least


def test_a_sample_is_its_substeps():
    """A sample of four substeps is four samples of one; a substep that does not divide the sample is shortened."""
    start, tension, force = PAPER.equilibrium([4.0, 0, 0]).state, [1.0, 2.0, 0.0], np.array([0.0, 0.1, 0.0])
    whole = values(PAPER.step_expression(0.02, 0.005), start, tension, force)
    assert np.allclose(run(PAPER.step_expression(0.005, 0.005), start, tension, 4, force)[-1], whole, atol=1e-12)
    assert np.allclose(values(PAPER.step_expression(0.02, 0.0066), start, tension, force), whole, atol=1e-12)


def test_the_default_substep_follows_the_slowest_mode():
    """1/250 of its period: 5 ms for the preset, a tenth of that for a rod a hundred times as stiff."""
    stiff = replace(PAPER, material=replace(PAPER.divisions[0].material, young=1e8))
    start = np.concatenate([0.1 * np.ones(8), np.zeros(8)])
    for rod, substep in ((PAPER, 0.05 / 10), (stiff, 0.05 / 93)):
        assert substep == pytest.approx(1 / (250 * rod.modes().frequency[0]), rel=0.09)
        given = values(rod.step_expression(0.05, substep * (1 + 1e-9)), start, np.zeros(3), np.zeros(3))
        assert np.allclose(values(rod.step_expression(0.05), start, np.zeros(3), np.zeros(3)), given, atol=1e-13)


def test_an_equilibrium_stays_where_it_is():
    rod = rich_rod()
    equilibrium = rod.equilibrium([2.0, 1.0, 0.5, 1e3], tip_force=(0.0, 0.05, 0.1))
    end = values(rod.step_expression(0.05, 0.005), equilibrium.state, equilibrium.input, [0.0, 0.05, 0.1])
    assert np.allclose(end, equilibrium.state, rtol=0, atol=1e-10)


def test_the_step_can_be_differentiated():
    x, u = ca.MX.sym("x", 16), ca.MX.sym("u", 3)
    end = PAPER.step_expression(0.05, 0.01)(x, u, np.zeros(3))
    along = ca.Function("along", [x, u], [ca.jtimes(end, u, ca.DM([1, 0, 0]))])
    start = PAPER.equilibrium([4.0, -1.0, 0.0]).state
    h = 1e-3
    ends = [values(PAPER.step_expression(0.05, 0.01), start, [2 + k * h, 1, 0], np.zeros(3)) for k in (-1, 1)]
    assert np.allclose(values(along, start, [2.0, 1.0, 0.0]), (ends[1] - ends[0]) / (2 * h), rtol=0, atol=1e-9)


def test_energy_without_damping_is_conserved():
    """Exactly by the equations, so to its tolerance by cvodes; to its order by the step."""
    payload = Payload(0.05, inertia=(1e-5, 2e-5, 2e-5), offset=(0.02, 0.01, 0.0))
    free = replace(
        PAPER,
        material=replace(PAPER.divisions[0].material, damping=0.0),
        gravity=(3.0, -9.81, 1.0),
        payloads=(payload,),
    )
    released = free.equilibrium([5.0, -3.0, 0.0], tip_force=(0.0, 1.0, 0.5)).state
    before = float(free.energy(released))
    # Zero of the potential is the base: measured against what is exchanged.
    exchanged = abs(before - float(free.energy(np.zeros(16))))
    end = values(free.reference_step(0.5), released, np.zeros(3), np.zeros(3))
    assert abs(float(free.energy(end)) - before) < 1e-7 * exchanged
    assert np.linalg.norm(end[8:]) > 0.1
    drift = [
        abs(float(free.energy(values(free.step_expression(0.2, h), released, np.zeros(3), np.zeros(3)))) - before)
        for h in (0.002, 0.001, 0.0005)
    ]
    assert drift[-1] < 1e-3 * exchanged
    assert drift[0] / drift[1] > 3.5
    assert drift[1] / drift[2] > 3.5


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"gravity": (9.81, 0.0, 0.0)},
        {"gravity": (2.0, -9.81, 0.0), "payloads": (Payload(0.05, offset=(0.0, 0.02, 0.0)), Payload(0.1, s=0.3))},
        {"drag": Drag((1.0, 3.0), (10.0, 40.0), (0.001, 0.001))},
    ],
    ids=["bare", "gravity", "payload", "drag"],
)
def test_energy_only_falls_with_damping(changes):
    rod = replace(PAPER, **changes)
    rest = float(rod.energy(rod.equilibrium().state))
    released = rod.equilibrium([10.0, -8.0, 3.0]).state
    energies = (
        np.array([float(rod.energy(x)) for x in run(rod.step_expression(0.05), released, np.zeros(3), 50)]) - rest
    )
    assert (np.diff(energies) < 0).all()
    assert energies[-1] > 0
    assert energies[-1] < 0.15 * energies[0]


@pytest.mark.parametrize(
    "material",
    [Material(1e8, 0.5, 1000.0, 1.1e4), Material(1e6, 0.5, 1.0, 1.1e4), Material(1e8, 0.3, 100.0, 0.0)],
)
def test_stiff_light_and_undamped_rods_stay_bounded_with_the_default_substep(material):
    rod = replace(PAPER, material=material)
    start = rod.equilibrium(material.young / 1e6 * np.array([10.0, -3.0, 0.0])).state
    before = float(rod.energy(start))
    end = run(rod.step_expression(0.05), start, np.zeros(3), 4)[-1]
    assert float(rod.energy(end)) < before * (1 + 1e-6)


def test_stiff_servos_and_thick_fluids_take_no_shorter_substeps():
    """Wires of 1e6 N/m, and drag that stops the rod in a fraction of a millisecond: the step is implicit in both."""
    servos = tuple(replace(cable, drive="length", stiffness=1e6, slack=False) for cable in PAPER.cables)
    wired = replace(PAPER, cables=servos, material=replace(PAPER.divisions[0].material, damping=5e4))
    given = [0.599, 0.6, 0.6002]
    held = wired.equilibrium(given)
    end = run(wired.step_expression(0.1, 0.005), np.zeros(16), given, 60)[-1]
    assert np.linalg.norm(values(wired.tip, end[:8]) - held.tip) < 0.01 * np.linalg.norm(held.tip[1:])
    thick = replace(PAPER, drag=Drag(linear=(2e4, 2e4), angular=(1.0, 1.0)))
    released = PAPER.equilibrium([10.0, -8.0, 3.0]).state
    energies = [float(thick.energy(x)) for x in run(thick.step_expression(0.05, 0.005), released, np.zeros(3), 10)]
    assert (np.diff(energies) < 0).all()
    assert energies[-1] > 0.5 * energies[0]  # it creeps
