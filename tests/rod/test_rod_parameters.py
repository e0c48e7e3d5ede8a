"""Symbolic parameters: one rod for all values of them, the same as a rod of numbers at each."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rod_support import coordinates, silicone_rod, values

from socasadi.rod import (
    Cable,
    Chamber,
    Converging,
    DistributedLoad,
    Division,
    Drag,
    Helix,
    Material,
    Payload,
    PointLoad,
    Rod,
    Section,
    Strain,
    Taper,
)

AT = {
    "young": 1.2e6,
    "poisson": 0.45,
    "density": 1100.0,
    "damping": 9e3,
    "radius": 0.03,
    "tip_radius": 0.02,
    "payload": 0.05,
    "payload_offset": 0.02,
    "payload_inertia": 3e-5,
    "gravity": -9.81,
    "force": 0.1,
    "moment": 0.01,
    "spread": 0.3,
    "cable": 0.018,
    "pitch": 0.4,
    "friction": 0.15,
    "wire": 2e4,
    "area": 1e-4,
    "rest": 0.7,
    "drag": 2.0,
    "bending": 0.5,
}


def rod(p, **changes) -> Rod:
    material = Material(p["young"], p["poisson"], p["density"], p["damping"])
    curved = Strain(bending_y=1, bending_z=1, torsion=0, rest=lambda x: (0, p["rest"] * x, 0, 1, 0, 0))
    ahead = Strain(bending_y=1, stretch=0, rest=(0, 0, p["rest"], 1, 0, 0))
    stiffness = (1.0, p["bending"], p["bending"], 3e3, 1e3, 1e3)
    return Rod(
        divisions=(
            Division(0.3, Taper("circle", p["radius"], p["tip_radius"]), material, curved),
            Division(0.3, Section.circle(p["tip_radius"]), material, ahead, stiffness=stiffness),
        ),
        cables=(
            Cable((p["cable"], 0.0), friction=p["friction"]),
            Cable(Helix(p["cable"], p["pitch"])),
            Cable(Converging((0.0, p["cable"]), (0.0, 0.005), 0.6), drive="length", stiffness=p["wire"], slack=False),
            Chamber((0.0, 0.01), p["area"]),
        ),
        gravity=(0.0, p["gravity"], 0.0),
        payloads=(
            Payload(p["payload"], inertia=(1e-5, p["payload_inertia"], 1e-5), offset=(p["payload_offset"], 0, 0)),
        ),
        loads=(
            PointLoad((0.0, p["force"], 0.0), (p["moment"], 0.0, 0.0), s=0.4, follower=True),
            DistributedLoad(lambda s: (0.0, 0.0, p["spread"] * s)),
        ),
        drag=Drag((0.1, p["drag"])),
        **changes,
    )


@pytest.fixture(scope="module")
def pair():
    symbols = {name: ca.SX.sym(name) for name in AT}
    return rod(symbols, parameters=tuple(symbols.values())), rod(AT)


P = np.array(list(AT.values()))


def test_functions_of_p_are_those_of_the_rod_of_numbers(pair):
    free, numeric = pair
    q, v = coordinates(numeric), coordinates(numeric, 1)
    x, u, a, tip = (
        np.concatenate([q, v]),
        np.array([3.0, 2.0, 0.59, 1e4]),
        coordinates(numeric, 2),
        np.linspace(-0.1, 0.1, 12),
    )
    calls = {
        "pose": (q, 0.45),
        "tip": (q,),
        "twist": (q, v, 0.45),
        "velocity": (q, v, 0.45),
        "strain": (q, 0.2),
        "mass": (q,),
        "bias": (q, v),
        "actuation": (q,),
        "cable_lengths": (q,),
        "cable_rates": (q, v),
        "tensions": (q, u),
        "energy": (x,),
        "forward_dynamics": (q, v, u),
        "inverse_dynamics": (q, v, a),
        "rhs": (x, u),
        "loaded_rhs": (x, u, tip),
        "forced_rhs": (x, u, tip[:3]),
    }
    valued = free.at(P)
    for name, arguments in calls.items():
        expected = values(getattr(numeric.model, name), *arguments)
        scale = np.abs(expected).max()
        for found in (
            values(getattr(free.model, name), *arguments, P),
            values(getattr(valued.model, name), *arguments),
        ):
            assert np.allclose(found, expected, rtol=0, atol=1e-11 * scale), name
    step = free.step_expression(0.02, 0.005)
    expected = values(numeric.step_expression(0.02, 0.005), x, u, np.zeros(3))
    assert np.allclose(values(step, x, u, np.zeros(3), P), expected, rtol=1e-10, atol=1e-12)


def test_each_parameter_matters(pair):
    """Each moves the accelerations or the energy: none is lost on the way."""
    free, _ = pair
    q, v = coordinates(free), coordinates(free, 1)
    x, u = np.concatenate([q, v]), np.array([3.0, 2.0, 0.59, 1e4])

    def all_of(p):
        return np.append(values(free.rhs, x, u, p), float(free.energy(x, p)))

    before = all_of(P)
    for i, name in enumerate(AT):
        changed = P.copy()
        changed[i] *= 1.001
        assert np.abs(all_of(changed) / before - 1).max() > 1e-9, name


def test_a_rod_at_values_is_a_rod_of_numbers(pair):
    free, numeric = pair
    valued = free.at(P)
    tension = [3.0, 2.0, 0.59, 1e4]
    equilibrium, expected = valued.equilibrium(tension), numeric.equilibrium(tension)
    assert np.allclose(equilibrium.tip, expected.tip, rtol=0, atol=1e-10)
    assert np.allclose(valued.modes(equilibrium).frequency, numeric.modes(expected).frequency, rtol=1e-8)
    assert np.allclose(valued.stiffness.full(), numeric.stiffness.full(), rtol=1e-12)
    assert np.allclose(valued.neutral, numeric.neutral, rtol=1e-12)
    assert valued.parameters == ()
    assert len(free.parameters) == len(AT)


def test_a_load_that_changes_in_time_is_a_parameter():
    push = ca.SX.sym("push", 3)
    pushed = silicone_rod(Strain(bending_y=1, bending_z=1), loads=(PointLoad(push),), parameters=push)
    plain = silicone_rod(Strain(bending_y=1, bending_z=1))
    x = np.concatenate([coordinates(plain), coordinates(plain, 1)])
    for force in ([0.1, 0.2, 0.3], [0.0, -0.1, 0.0]):
        expected = values(plain.forced_rhs, x, [], force)
        assert np.allclose(values(pushed.rhs, x, [], force), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_cvodes_and_the_step_agree_with_parameters():
    E, load = ca.SX.sym("E"), ca.SX.sym("load")
    free = silicone_rod(
        Strain(bending_y=1),
        material=Material(E, 0.5, 1000.0, 1e4),
        loads=(PointLoad((0, 0, load)),),
        parameters=(E, load),
    )
    p = [8e5, 0.1]
    exact = values(free.reference_step(0.1), np.zeros(4), [], np.zeros(3), p)
    found = values(free.step_expression(0.1, 0.001), np.zeros(4), [], np.zeros(3), p)
    assert np.allclose(found, exact, rtol=0, atol=1e-4 * np.abs(exact).max())


def test_what_needs_numbers_says_how_to_give_them(pair):
    free, _ = pair
    numbers = {
        "equilibrium": lambda: free.equilibrium(),
        "equilibrium_at": lambda: free.equilibrium_at((0.0, 0.0)),
        "modes": lambda: free.modes(),
        "linearise": lambda: free.linearise(),
        "centreline": lambda: free.centreline(np.zeros(free.dof)),
        "stiffness": lambda: free.stiffness,
        "damping": lambda: free.damping_matrix,
        "neutral": lambda: free.neutral,
    }
    for name, call in numbers.items():
        with pytest.raises(ValueError, match=r"parameters young, poisson, .* have no values; use rod.at\(") as caught:
            call()
        assert "\n" not in str(caught.value), name
    with pytest.raises(ValueError, match="substep is not given, and its default follows from the values"):
        free.step(0.05)


@pytest.mark.parametrize("name", AT)
def test_an_undeclared_symbol_is_named(name):
    symbol = ca.SX.sym(f"my_{name}")
    with pytest.raises(ValueError, match=rf"the symbol my_{name} is used but not among parameters; add it there"):
        rod(AT | {name: symbol})


@pytest.mark.parametrize(
    ("name", "value"), [("young", -1e6), ("poisson", 0.6), ("radius", 0.0), ("payload", -0.1), ("friction", -1.0)]
)
def test_values_that_no_rod_can_have_are_refused(pair, name, value):
    free, _ = pair
    with pytest.raises(ValueError, match=f"is {value}"):
        free.at(np.where(np.array(list(AT)) == name, value, P))


def test_a_length_is_a_number():
    with pytest.raises(ValueError, match="length is the expression L"):
        silicone_rod(Strain(bending_z=0), length=ca.SX.sym("L"))


def test_a_rod_with_parameters_can_be_pickled_once_it_has_values(pair):
    # Functions of one's own cannot be pickled.
    valued = replace(pair[0], loads=(), divisions=pair[0].divisions[1:]).at(P)
    before = valued.equilibrium().tip
    assert np.allclose(pickle.loads(pickle.dumps(valued)).equilibrium().tip, before)
