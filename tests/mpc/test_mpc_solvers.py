"""QP back ends agree and are checked; where they fail, the fallback keeps the inputs inside their bounds."""

import casadi
import numpy as np
import pytest

from socasadi.model import Modal
from socasadi.mpc import BACKENDS, KKT_TOLERANCE, LinearMPC, _law, control_law
from socasadi.mpc._law import rest_state
from socasadi.mpc._qp import kkt_residual, qp_solver

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
TIGHT = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=(-0.03, 0.03))


def with_backend(mpc, name):
    return LinearMPC(**{**{f: getattr(mpc, f) for f in mpc.__dataclass_fields__}, "backend": name})


def test_the_back_ends_are_three_and_qrqp_is_none_of_them():
    """qrqp reports wrong answers as success, so it must not come in under any name."""
    assert set(BACKENDS) == {"daqp", "qpoases", "osqp"}
    with pytest.raises(ValueError, match="unknown QP back end 'qrqp'; there are daqp, qpoases, osqp"):
        LinearMPC(Modal(), backend="qrqp")


@pytest.mark.parametrize("output_bounds", [(-0.03, 0.03), None], ids=["soft outputs", "inputs only"])
def test_the_back_ends_agree_along_a_random_closed_loop(output_bounds):
    mpc = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=output_bounds)
    controllers = {name: with_backend(mpc, name).controller(THETA) for name in BACKENDS}
    rng = np.random.default_rng(1)
    x, y, wanted, at_bound = np.zeros(4), np.zeros(2), np.zeros(2), 0
    for t in range(200):
        if t % 10 == 0:
            wanted = rng.uniform(-0.06, 0.06, 2)
        u = {name: controller.step(y, wanted) for name, controller in controllers.items()}
        for name in BACKENDS:
            assert np.allclose(u[name], u["qpoases"], rtol=0, atol=4e-5), name
        x = SYSTEM.A @ x + SYSTEM.B @ u["qpoases"]
        y = SYSTEM.C @ x + 1e-3 * rng.standard_normal(2)
        at_bound += (np.abs(u["qpoases"]) == 4).any()
    assert 20 < at_bound < 180
    for name, controller in controllers.items():
        assert (controller.info.steps, controller.info.fallbacks) == (200, 0), name
        assert controller.info.worst_residual <= KKT_TOLERANCE


@pytest.mark.parametrize("name", BACKENDS)
def test_a_back_end_solves_random_problems_to_their_optimality_conditions(name):
    """Random boxes and rows, checked by conditions written in numpy."""
    rng = np.random.default_rng(2)
    solver = qp_solver(name, 6, 5)
    for _ in range(30):
        root, g, A, b = rng.normal(size=(6, 6)), 3 * rng.normal(size=6), rng.normal(size=(5, 6)), rng.uniform(0.1, 1, 5)
        H = root @ root.T + 0.1 * np.eye(6)
        answer = solver(h=H, g=g, a=A, lba=-np.inf, uba=b, lbx=-1, ubx=1)
        v, at_box, at_row = (answer[key].full().ravel() for key in ("x", "lam_x", "lam_a"))
        assert np.allclose(H @ v + g + A.T @ at_row + at_box, 0, atol=2e-6)
        assert np.abs(v).max() <= 1 + 1e-6
        assert (A @ v - b).max() <= 1e-6
        assert at_row.min() >= -1e-6
        assert np.abs(at_row * (b - A @ v)).max() <= 1e-5
        assert np.abs(np.maximum(at_box, 0) * (1 - v)).max() <= 1e-5
        assert np.abs(np.minimum(at_box, 0) * (1 + v)).max() <= 1e-5


@pytest.mark.parametrize("name", BACKENDS)
def test_a_back_end_prints_nothing(name, capfd):
    controller = with_backend(TIGHT, name).controller(THETA)
    for wanted in (0.0, 0.05, -0.05):
        controller.step([0.01, 0.0], [wanted, wanted])
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def test_what_was_printed_before_a_silenced_solver_is_not_lost(capfd):
    print("before")
    with_backend(TIGHT, "qpoases").controller(THETA)
    print("after")
    assert capfd.readouterr().out == "before\nafter\n"


def residual(v, at_box, at_row, upper=(1.0, np.inf), g=(-4, -2), row=1.5):
    """Of min v'v + g'v, 0 <= v <= upper, v_1 + v_2 <= row.

    By hand, for what is preset: v = (1, 0.5), where the gradient is (-2, -1), so that the row has multiplier 1 and so
    has v_1 <= 1.
    """
    H, A = casadi.MX(2 * casadi.DM.eye(2)), casadi.MX(casadi.DM.ones(1, 2))
    given = [casadi.MX(casadi.DM(value)) for value in (v, at_box, at_row)]
    found = kkt_residual(H, casadi.MX(g), A, casadi.MX(row), casadi.DM([0, 0]), casadi.DM(upper), *given)
    return float(casadi.evalf(found))


def test_the_right_answer_has_no_residual():
    assert residual((1, 0.5), (1, 0), [1]) == 0
    assert residual((0, 1), (-1, 0), [0], g=(1, -2)) == 0


@pytest.mark.parametrize(
    ("arguments", "size"),
    [
        ({"v": (1, 0.5), "at_box": (1, 0), "at_row": [1.5]}, 0.1),
        ({"v": (1, 0.4), "at_box": (0.8, 0), "at_row": [1.2]}, 0.12),
        ({"v": (1, 0.7), "at_box": (1.4, 0), "at_row": [0.6]}, 0.2),
        ({"v": (2.5, 1.5), "at_box": (0, 0), "at_row": [-1], "upper": (9, 9), "row": 4}, 1.0),
        ({"v": (2, 1), "at_box": (0, 0), "at_row": [0], "row": 4}, 1.0),
        ({"v": (-0.5, 1), "at_box": (0, 0), "at_row": [0], "g": (1, -2)}, 0.5),
        ({"v": (0.5, 0.25), "at_box": (3, 1.5), "at_row": [0], "upper": (1, 0.25)}, 1.5),
        ({"v": (0.5, 1), "at_box": (-2, 0), "at_row": [0], "g": (1, -2)}, 1.0),
        ({"v": (1, 0.5), "at_box": (2, 1), "at_row": [0]}, 1.0),
    ],
    ids=[
        "not stationary",
        "multiplier of a row that is not reached",
        "row violated",
        "negative multiplier of a row",
        "above an upper bound",
        "below a lower bound",
        "multiplier away from the upper bound",
        "multiplier away from the lower bound",
        "multiplier of a bound that is not there",
    ],
)
def test_each_condition_that_is_broken_alone_is_noticed(arguments, size):
    assert residual(**arguments) == pytest.approx(size, rel=1e-9)


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf])
def test_an_answer_that_is_not_finite_is_not_believed(hole):
    for arguments in (((hole, 0.5), (1, 0), [1]), ((1, 0.5), (hole, 0), [1]), ((1, 0.5), (1, 0), [hole])):
        assert not residual(*arguments) <= KKT_TOLERANCE


def law_inputs(mpc, rng):
    state = np.concatenate([0.02 * rng.normal(size=4), 0.01 * rng.normal(size=2), rng.uniform(-1, 1, 3)])
    return 0.02 * rng.normal(size=2), 0.05 * rng.normal(size=mpc.horizon * 2), state


def test_without_the_qp_the_unconstrained_answer_is_clipped():
    """What a QP with bounds out of reach answers, cut to the bounds; the weight in newtons does not move with them."""
    near = LinearMPC(Modal(), input_term="literal", R=1e-3, input_bounds=(-4, 4))
    far = LinearMPC(Modal(), input_term="literal", R=1e-3, input_bounds=(-4000, 4000), output_bounds=None)
    clipped_law = control_law(near, near.design(SYSTEM), with_qp=False)
    free_law = control_law(far, far.design(SYSTEM))
    rng, clipped = np.random.default_rng(3), 0
    for _ in range(40):
        size = 10 ** rng.uniform(-2, 0)
        y, reference, state = (size * values for values in law_inputs(near, rng))
        u, _, status, residual = clipped_law(y, reference, state)
        free, _, solved, _ = free_law(y, reference, np.r_[state[:6], state[6:] / 1000])
        assert (int(status), float(residual), int(solved)) == (1, np.inf, 0)
        assert np.allclose(u.full(), np.clip(free.full(), -4, 4), rtol=0, atol=1e-4)
        clipped += (np.abs(u.full()) == 4).any()
    assert 5 < clipped < 35


@pytest.mark.parametrize("before", [(1.0, -2.0, 3.0), (9.0, -2.0, -9.0)])
def test_with_a_reference_that_is_no_number_the_input_before_is_held(before):
    design = TIGHT.design(SYSTEM)
    state = rest_state(TIGHT, design, np.array(before))
    law = control_law(TIGHT, design, with_qp=False)
    u, after, status, _ = law(np.zeros(2), np.full(20, np.nan), state)
    assert int(status) == 2
    assert np.array_equal(u.full().ravel(), np.clip(before, -4, 4))
    assert np.isfinite(after.full()).all()


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf])
def test_a_measurement_that_is_no_number_corrects_nothing(hole):
    design = TIGHT.design(SYSTEM)
    _, reference, state = law_inputs(TIGHT, np.random.default_rng(5))
    u, after, status, _ = control_law(TIGHT, design)(np.array([hole, 0.01]), reference, state)
    assert int(status) == 0
    assert np.allclose(
        after.full().ravel()[:4], SYSTEM.A @ state[:4] + 4 * SYSTEM.B @ state[6:], rtol=1e-12, atol=1e-15
    )
    assert np.array_equal(after.full().ravel()[4:6], state[4:6])
    assert np.abs(u.full()).max() <= 4


def wrong_solver(name, variables, rows):
    """A solver that is off by a thousandth and says nothing."""
    right = qp_solver(name, variables, rows)
    given = right.mx_in()
    answers = list(right(*given))
    answers[0] = answers[0] + 1e-3
    return casadi.Function("qp", given, answers, right.name_in(), right.name_out())


class GivesUp(casadi.Callback):
    """A solver that solves until it is told to raise, and then raises for good."""

    made: list["GivesUp"]

    def __init__(self, name, variables, rows):
        casadi.Callback.__init__(self)
        self.right, self.spent = qp_solver(name, variables, rows), False
        self.construct("qp", {})
        GivesUp.made.append(self)

    def get_n_in(self):
        return self.right.n_in()

    def get_n_out(self):
        return self.right.n_out()

    def get_name_in(self, i):
        return self.right.name_in(i)

    def get_name_out(self, i):
        return self.right.name_out(i)

    def get_sparsity_in(self, i):
        return self.right.sparsity_in(i)

    def get_sparsity_out(self, i):
        return self.right.sparsity_out(i)

    def eval(self, arg):
        if self.spent:
            raise RuntimeError("gave up")
        return self.right.call(arg)


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_a_wrong_answer_is_replaced_by_the_clipped_law_and_counted(monkeypatch, scale):
    monkeypatch.setattr(_law, "qp_solver", wrong_solver)
    controller, rng = TIGHT.controller(THETA), np.random.default_rng(6)
    expected = control_law(TIGHT, controller.design, with_qp=False)
    for _ in range(20):
        y, wanted = scale * 0.01 * rng.normal(size=2), scale * 0.01 * rng.normal(size=2)
        state = controller._state
        u = controller.step(y, wanted)
        assert np.allclose(u, expected(y, np.tile(wanted, 10), state)[0].full().ravel(), rtol=0, atol=1e-12)
        assert np.abs(u).max() <= 4
    info = controller.info
    assert (info.steps, info.clipped, info.held, info.fallbacks, info.worst_residual) == (20, 20, 0, 20, 0.0)
    controller.reset()
    assert controller.info.fallbacks == 0


def test_a_solver_that_raises_is_replaced_by_the_clipped_law_and_made_anew(monkeypatch, capfd):
    GivesUp.made = []
    monkeypatch.setattr(_law, "qp_solver", GivesUp)
    controller, healthy = TIGHT.controller(THETA), TIGHT.controller(THETA)
    expected = control_law(TIGHT, controller.design, with_qp=False)
    y, wanted = np.array([0.001, 0.002]), np.array([0.02, 0.01])
    assert np.array_equal(controller.step(y, wanted), healthy.step(y, wanted))
    GivesUp.made[0].spent = True
    state = controller._state
    u = controller.step(y, wanted)
    assert np.allclose(u, expected(y, np.tile(wanted, 10), state)[0].full().ravel(), rtol=0, atol=1e-12)
    assert (controller.info.steps, controller.info.clipped) == (2, 1)
    controller.step(y, wanted)
    assert (controller.info.steps, controller.info.clipped) == (3, 1)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("size", [1e6, 1e30, 1e200, 1e308])
def test_absurd_measurements_and_references_leave_the_inputs_inside_their_bounds(name, size, capfd):
    controller = with_backend(TIGHT, name).controller(THETA)
    calls = [
        ([size, -size], [0, 0]),
        ([0, 0], [size, 0]),
        ([0, 0], [0, 0]),
        ([size, size], [-size, 0]),
        ([0, 0], [0, 0]),
    ]
    for y, wanted in calls:
        u = controller.step(y, wanted)
        assert np.isfinite(u).all()
        assert np.abs(u).max() <= 4
    assert controller.info.steps == len(calls)
