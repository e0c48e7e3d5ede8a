"""Generated C against the interpreted functions, on a rod with something of everything."""

import casadi as ca
import numpy as np
import pytest
from rod_support import SILICONE, coordinates, rich_rod, values

from socasadi.codegen import c_compiler, compiled
from socasadi.rod import Material, Rod

YOUNG = ca.SX.sym("E")
RICH = rich_rod(material=Material(YOUNG, 0.5, SILICONE.density, SILICONE.damping), parameters=(YOUNG,))
EXACT = {  # kinematics, mass and forces
    "pose": "qs",
    "tip": "q",
    "twist": "qvs",
    "velocity": "qvs",
    "strain": "qs",
    "mass": "q",
    "bias": "qv",
    "actuation": "q",
    "cable_lengths": "q",
    "cable_rates": "qv",
    "energy": "x",
    "inverse_dynamics": "qva",
}
ACCELERATIONS = {"rhs": "xu", "forward_dynamics": "qvu", "forced_rhs": "xuf"}


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
def test_machine_code_agrees_with_the_interpreter():
    """To 1e-12 of the largest entry; accelerations to the condition of the mass matrix times rounding."""
    n = RICH.dof
    given = {
        "q": ca.MX.sym("q", n),
        "v": ca.MX.sym("v", n),
        "a": ca.MX.sym("a", n),
        "u": ca.MX.sym("u", 4),
        "f": ca.MX.sym("f", 3),
        "s": ca.MX.sym("s"),
        "p": ca.MX.sym("p"),
    }
    inputs = list(given.values())
    arguments = given | {"x": ca.vertcat(given["q"], given["v"])}
    names = EXACT | ACCELERATIONS
    outputs = [getattr(RICH.model, name)(*(arguments[key] for key in keys + "p")) for name, keys in names.items()]
    outputs.append(RICH.step_expression(0.02, 0.005)(arguments["x"], given["u"], given["f"], given["p"]))
    interpreted = ca.Function("everything", inputs, outputs, list(given), [*(f"{name}_" for name in names), "step_"])
    machine = compiled(interpreted)
    for seed in range(3):
        q, v, a = (coordinates(RICH, 3 * seed + k) for k in range(3))
        numbers = (q, v, a, [3.0, 2.0, -1.0, 1e3], [0.1, -0.1, 0.2], 0.1 + 0.2 * seed, 1e6)
        condition = np.linalg.cond(values(RICH.mass, q, 1e6))
        for name, one, other in zip((*names, "step"), interpreted(*numbers), machine(*numbers), strict=True):
            expected, found = one.full(), other.full()
            tolerance = 1e-12 if name in EXACT else 1e-15 * condition
            assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max(), name
        assert 1e-15 * condition < 1e-7


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
def test_a_compiled_step_is_the_interpreted_one():
    rod = Rod.preset("paper")
    start, tension, force = rod.equilibrium([5.0, -3.0, 0.0]).state, [0.0, 1.0, 2.0], [0.0, 0.1, 0.0]
    machine = rod.step(0.05)
    expected = values(rod.step_expression(0.05), start, tension, force)
    assert machine.is_a("External")
    assert np.allclose(values(machine, start, tension, force), expected, rtol=1e-10, atol=1e-10)
    assert rod.step(0.05) is machine
