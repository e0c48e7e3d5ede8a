"""QP back ends agree and are checked; where they fail, the fallback keeps the inputs inside their bounds."""

from dataclasses import replace

import casadi
import numpy as np
import pytest

from socasadi.model import Modal
from socasadi.mpc import BACKENDS, KKT_TOLERANCE, LinearMPC, _law, control_law, rest_state
from socasadi.mpc.solvers._qp import QuadraticProgram, Shape, kkt_residual, qp_solver
from socasadi.mpc.solvers._solve import solve

THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
TIGHT = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=(-0.03, 0.03), backend="daqp")
SOFT = replace(TIGHT, slack_linear=30.0, rate_bounds=(-60, 60))


def test_the_back_ends_are_four_and_qrqp_is_none_of_them():
    """qrqp reports wrong answers as success, so it must not come in under any name."""
    assert set(BACKENDS) == {"active-set", "daqp", "qpoases", "osqp"}
    with pytest.raises(ValueError, match="unknown QP back end 'qrqp'; there are active-set, daqp, qpoases, osqp"):
        LinearMPC(Modal(), backend="qrqp")
    with pytest.raises(ValueError, match="unknown QP back end 'qrqp'; there are active-set, daqp, qpoases, osqp"):
        solve(random_program(np.random.default_rng(0)), "qrqp")


@pytest.mark.parametrize(
    "change",
    [{}, {"output_bounds": None}, {"slack_linear": 30.0}, {"rate_bounds": (-150, 150), "control_horizon": (1, 2, 7)}],
    ids=["soft outputs", "inputs only", "linear slack", "rate bounds and blocks"],
)
def test_the_back_ends_agree_along_a_random_closed_loop(change):
    mpc = replace(TIGHT, **change)
    controllers = {name: replace(mpc, backend=name).controller(THETA) for name in BACKENDS}
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
    assert 5 < at_bound < 180
    for name, controller in controllers.items():
        assert (controller.info.steps, controller.info.fallbacks) == (200, 0), name
        assert controller.info.worst_residual <= KKT_TOLERANCE


def random_program(rng, variables=6, rows=10, soft=4):
    """Feasible at 0. Half of the soft rows have a price."""
    root, hard = rng.normal(size=(variables, variables)), rows - soft
    return QuadraticProgram(
        hessian=root @ root.T + 0.1 * np.eye(variables),
        gradient=10 * rng.normal(size=variables),
        rows=rng.normal(size=(rows, variables)),
        lower=-rng.uniform(0.1, 1, rows),
        upper=rng.uniform(0.1, 1, rows),
        quadratic=np.r_[np.full(hard, np.inf), 10 ** rng.uniform(0, 4, soft)],
        price=np.r_[np.zeros(hard), rng.uniform(0, 5, soft) * rng.integers(0, 2, soft)],
    )


def dependent_program(rng):
    """Rows twice, rows in multiples, soft rows twice, an equality."""
    program = random_program(rng)
    rows, lower, upper = program.rows.copy(), program.lower.copy(), program.upper.copy()
    rows[1], rows[2], rows[7] = rows[0], -2 * rows[0], rows[6]
    lower[1], upper[1], lower[2], upper[2] = lower[0], upper[0], -2 * upper[0], -2 * lower[0]
    lower[3] = upper[3] = rows[3] @ (0.05 * rng.normal(size=6))
    return program._replace(rows=rows, lower=lower, upper=upper)


def vertex_program(rng):
    """Eight rows meet in one point of three dimensions, which is the answer; some with multipliers, some without."""
    program, vertex = random_program(rng, 3, 8, 0), np.array([0.1, -0.2, 0.3])
    push = rng.uniform(0, 3, 8) * (rng.random(8) < 0.6)
    return program._replace(
        lower=np.full(8, -np.inf),
        upper=program.rows @ vertex,
        gradient=-program.hessian @ vertex - program.rows.T @ push,
    )


def scaled_program(rng):
    """Variables and rows in units that are orders of magnitude apart."""
    program, of_z, of_rows = random_program(rng), 10 ** rng.uniform(-2, 2, 6), 10 ** rng.uniform(-2, 2, 10)
    return QuadraticProgram(
        hessian=program.hessian * np.outer(of_z, of_z),
        gradient=program.gradient * of_z,
        rows=program.rows * of_z * of_rows[:, None],
        lower=program.lower * of_rows,
        upper=program.upper * of_rows,
        quadratic=program.quadratic / of_rows**2,
        price=program.price / of_rows,
    )


def infeasible_program(rng):
    """A positive combination of three rows is to be more than their upper bounds allow, by a little or by much."""
    program, weights = random_program(rng), rng.uniform(0.2, 1, 3)
    rows, lower, upper = program.rows.copy(), program.lower.copy(), program.upper.copy()
    rows[3] = weights @ rows[:3]
    lower[3] = weights @ upper[:3] + 10 ** rng.uniform(-3, 1)
    upper[3] = np.inf
    return program._replace(rows=rows, lower=lower, upper=upper)


def cost(program, z):
    """Of z, with the slacks that are best for it, written out."""
    value = program.rows @ z
    beyond = np.maximum(np.maximum(value - program.upper, program.lower - value), 0)
    soft = np.isfinite(program.quadratic)
    assert beyond[~soft].max(initial=0) <= 1e-6
    slack = beyond[soft]
    paid = program.price[soft] @ slack + program.quadratic[soft] @ slack**2 / 2
    return z @ program.hessian @ z / 2 + program.gradient @ z + paid


@pytest.mark.parametrize("kind", [random_program, dependent_program, vertex_program, scaled_program])
def test_the_back_ends_agree_on_programs_of_every_kind(kind):
    rng = np.random.default_rng(2)
    for _ in range(25):
        program = kind(rng)
        answers = {name: solve(program, name) for name in BACKENDS}
        best = answers["qpoases"]
        for name, answer in answers.items():
            if (name, kind) == ("osqp", scaled_program) and answer.status == "failed":
                continue  # a first-order method may give up there, and says so
            assert answer.status == "optimal", name
            assert answer.residual <= KKT_TOLERANCE
            assert np.allclose(answer.z, best.z, rtol=2e-6, atol=2e-6 * np.abs(best.z).max()), name


@pytest.mark.parametrize("name", BACKENDS)
def test_no_point_nearby_is_better(name):
    """The cost itself, slacks and prices included, rises in every direction that the hard rows leave open."""
    rng, risen = np.random.default_rng(3), 0
    for _ in range(10):
        program = random_program(rng)
        z = solve(program, name).z
        least = cost(program, z)
        for _ in range(100):
            other = z + 10 ** rng.uniform(-3, 0) * rng.normal(size=6)
            value, hard = program.rows @ other, np.isinf(program.quadratic)
            if ((value <= program.upper) & (value >= program.lower))[hard].all():
                assert cost(program, other) > least - 1e-6
                risen += 1
    assert risen > 50


@pytest.mark.parametrize("name", BACKENDS)
def test_a_contradiction_is_called_infeasible_and_no_answer_is_given(name):
    rng = np.random.default_rng(4)
    for _ in range(25):
        answer = solve(infeasible_program(rng), name)
        assert answer.status == "infeasible"
        assert np.isnan(answer.z).all()
        assert np.isnan(answer.multipliers).all()
        assert not answer.residual <= KKT_TOLERANCE


def test_an_answer_that_is_not_one_is_called_failed(monkeypatch):
    program = random_program(np.random.default_rng(5))
    right = solve(program)
    wrongs = {"off": right.z + 1e-4, "nan": right.z * np.nan, "infinite": right.z * np.inf}
    for z in wrongs.values():
        monkeypatch.setitem(solve.__globals__["_SOLVERS"], "daqp", lambda _, z=z: (z, right.multipliers))
        answer = solve(program, "daqp")
        assert answer.status == "failed"
        assert np.isnan(answer.z).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gradient": np.zeros(5)}, r"gradient has shape \(5,\), but \(6,\) fits 6 variables and 10 rows"),
        ({"lower": np.full(10, np.nan)}, "lower of the quadratic program holds NaN"),
        ({"price": np.full(10, -1.0)}, "a soft row has a positive quadratic weight and a price that is not negative"),
        ({"quadratic": np.zeros(10)}, "a soft row has a positive quadratic weight"),
    ],
)
def test_a_program_whose_parts_do_not_fit_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        solve(random_program(np.random.default_rng(0))._replace(**change))


@pytest.mark.parametrize("name", BACKENDS)
def test_a_back_end_prints_nothing(name, capfd):
    controller = replace(TIGHT, backend=name).controller(THETA)
    for wanted in (0.0, 0.05, -0.05):
        controller.step([0.01, 0.0], [wanted, wanted])
    solve(random_program(np.random.default_rng(0)), name)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def test_what_was_printed_before_a_silenced_solver_is_not_lost(capfd):
    print("before")
    replace(TIGHT, backend="qpoases").controller(THETA)
    print("after")
    assert capfd.readouterr().out == "before\nafter\n"


# min z1^2 + z2^2 + f'z with 0 <= z <= (1, inf), and z1 + z2 <= 1.5 softly: price 0.5, quadratic 4. H^-1 is I/2, so that
# a multiplier moves z1 or z2 by a half of it, and the soft row by all of it.
SMALL = Shape(2 * np.eye(2), np.array([[1.0, 0], [0, 1], [1, 1]]), np.array([np.inf, np.inf, 4]), np.array([0, 0, 0.5]))
LOWER, UPPER = np.array([0.0, 0.0, -np.inf]), np.array([1.0, np.inf, 1.5])


def residual(z, multipliers, f=(-4.0, -2.0)):
    return float(kkt_residual(SMALL)(f, LOWER, UPPER, z, multipliers))


@pytest.mark.parametrize(
    ("f", "z", "multipliers"),
    [
        ((-4, -1), (1, 0.5), (2, 0, 0)),
        ((-4, -1.4), (1, 0.5), (1.6, 0, 0.4)),
        ((-4, -2.1), (1, 0.6), (1.1, 0, 0.9)),
        ((1, -2), (0, 1), (-1, 0, 0)),
        ((1, 1), (0, 0), (-1, -1, 0)),
    ],
    ids=["row just reached", "row held by its price", "row exceeded", "lower bound", "corner"],
)
def test_the_right_answer_has_no_residual(f, z, multipliers):
    """By hand: 2 z + f + (sum of multipliers times rows) = 0, and the soft row's multiplier is 0.5 + 4 s beyond it."""
    assert residual(z, multipliers, f) == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(
    ("f", "z", "multipliers", "size"),
    [
        # z is 0.1 from where its multipliers put it, relative to 1 + max |z|; every row condition holds.
        ((-4, -1), (1, 0.5), (2.2, 0, 0), 0.05),
        # A hard upper bound, exceeded by 0.2.
        ((-4, 1), (1.2, 0), (1.6, -1, 0), 0.2),
        # The lower bound, by 0.5.
        ((1, -2), (-0.5, 1), (0, 0, 0), 0.5),
        # A multiplier of 1 moves z1 by a half; at 0.5 there is 0.5 of room, of which it would take all that it moves.
        ((-2, 0), (0.5, 0), (1, 0, 0), 0.5),
        # The wrong sign at the upper bound: the multiplier pulls it inwards by 0.25.
        ((-1.5, 0), (1, 0), (-0.5, 0, 0), 0.25),
        # A multiplier of a side that has no bound.
        ((0, -3), (0, 1), (0, 1, 0), 0.5),
        # The soft row, exceeded by 0.1 at a multiplier that is only its price: slack 0.1 x 4 is not paid.
        ((-4, -1.7), (1, 0.6), (1.5, 0, 0.5), 0.08),
        # The soft row, not exceeded though its multiplier is 0.4 above its price: (0.4 / (1 + 4)) is due.
        ((-4, -1.9), (1, 0.5), (1.1, 0, 0.9), 0.08),
    ],
    ids=[
        "not stationary",
        "above a hard bound",
        "below a hard bound",
        "multiplier away from its bound",
        "multiplier of the wrong sign",
        "multiplier of a bound that is not there",
        "slack that is not paid for",
        "slack that is paid for and not taken",
    ],
)
def test_each_condition_that_is_broken_alone_is_noticed(f, z, multipliers, size):
    assert residual(z, multipliers, f) == pytest.approx(size, rel=1e-9)


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf])
def test_an_answer_that_is_not_finite_is_not_believed(hole):
    for z, multipliers in (((hole, 0.5), (1, 0, 0)), ((1, 0.5), (hole, 0, 0)), ((1, 0.5), (1, 0, hole))):
        assert not residual(z, multipliers) <= KKT_TOLERANCE
    assert not residual((1, 0.5), (2, 0, 0), (hole, -1)) <= KKT_TOLERANCE


def test_a_row_that_nothing_moves_does_not_count_unless_it_is_violated():
    program = random_program(np.random.default_rng(6))
    rows = program.rows.copy()
    rows[0], rows[9] = 0, 0
    answer = solve(program._replace(rows=rows))
    assert answer.status == "optimal"
    lower = program.lower.copy()
    lower[0] = 0.05
    assert solve(program._replace(rows=rows, lower=lower)).status == "infeasible"


def law_inputs(mpc, rng):
    """A measurement, a reference, what is measured of disturbances, and a state of the controller."""
    design = mpc.design(SYSTEM)
    state = 0.02 * rng.normal(size=design.order), rng.uniform(-1, 1, design.inputs), np.zeros(design.disturbances)
    reference = 0.05 * rng.normal(size=design.preview * 2)
    return 0.02 * rng.normal(size=2), reference, rng.normal(size=design.disturbances), np.concatenate(state)


def test_without_the_qp_the_unconstrained_answer_is_clipped():
    """What a QP with bounds out of reach answers, cut to the bounds; the weight in newtons does not move with them."""
    near = LinearMPC(Modal(), input_term="literal", R=1e-3, input_bounds=(-4, 4))
    far = LinearMPC(Modal(), input_term="literal", R=1e-3, input_bounds=(-4000, 4000), output_bounds=None)
    clipped_law = control_law(near, near.design(SYSTEM), with_qp=False)
    free_law = control_law(far, far.design(SYSTEM))
    rng, clipped = np.random.default_rng(3), 0
    for _ in range(40):
        size = 10 ** rng.uniform(-2, 0)
        y, reference, w, state = (size * values for values in law_inputs(near, rng))
        u, _, status, residual, _ = clipped_law(y, reference, w, state)
        free, _, solved, _, _ = free_law(y, reference, w, np.r_[state[:6], state[6:] / 1000])
        assert (int(status), float(residual), int(solved)) == (1, np.inf, 0)
        assert np.allclose(u.full(), np.clip(free.full(), -4, 4), rtol=0, atol=1e-4)
        clipped += (np.abs(u.full()) == 4).any()
    assert 5 < clipped < 35


@pytest.mark.parametrize("before", [(1.0, -2.0, 3.0), (9.0, -2.0, -9.0)])
@pytest.mark.parametrize("with_qp", [True, False])
@pytest.mark.parametrize("hole", [np.nan, np.inf])
def test_with_a_reference_that_is_no_number_the_input_before_is_held(before, with_qp, hole):
    design = SOFT.design(SYSTEM)
    state = rest_state(SOFT, design, np.array(before))
    law = control_law(SOFT, design, with_qp=with_qp)
    u, after, status, _, refused = law(np.zeros(2), np.r_[np.zeros(19), hole], (), state)
    assert (int(status), int(refused)) == (2, 0)
    assert np.array_equal(u.full().ravel(), np.clip(before, -4, 4))
    assert np.isfinite(after.full()).all()


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf, 300.0])
def test_a_measurement_that_cannot_be_corrects_nothing(hole):
    """No number, or ten thousand times the bound of 3 cm."""
    design = TIGHT.design(SYSTEM)
    _, reference, w, state = law_inputs(TIGHT, np.random.default_rng(5))
    u, after, status, _, refused = control_law(TIGHT, design)(np.array([hole, 0.01]), reference, w, state)
    assert (int(status), int(refused)) == (0, 1)
    assert np.allclose(
        after.full().ravel()[:4], SYSTEM.A @ state[:4] + 4 * SYSTEM.B @ state[6:], rtol=1e-12, atol=1e-15
    )
    assert np.array_equal(after.full().ravel()[4:6], state[4:6])
    assert np.abs(u.full()).max() <= 4
    _, _, _, _, refused = control_law(TIGHT, design)(np.array([299.0, 0.01]), reference, w, state)
    assert int(refused) == 0


@pytest.mark.parametrize("hole", [np.nan, np.inf])
def test_a_measured_disturbance_that_is_no_number_is_taken_to_be_the_one_before(hole):
    mpc = replace(TIGHT, measured_disturbances=2)
    y, reference, _, state = law_inputs(mpc, np.random.default_rng(5))
    law = control_law(mpc, mpc.design(SYSTEM))
    state[-2:] = 0.3, -0.7
    u, after, *_ = law(y, reference, [hole, 0.2], state)
    assert np.array_equal(after.full().ravel()[-2:], [0.3, 0.2])
    assert np.array_equal(u.full(), law(y, reference, [0.3, 0.2], state)[0].full())


@pytest.mark.parametrize("with_qp", [True, False])
def test_the_input_is_inside_its_bounds_and_its_rate_bounds_whatever_the_state(with_qp):
    """Also where the input before is out of its bounds: the change is then counted from the bound."""
    mpc = replace(TIGHT, rate_bounds=((-20, -np.inf, -5), (10, 30, np.inf)))
    design, rng, limited = mpc.design(SYSTEM), np.random.default_rng(7), 0
    law = control_law(mpc, design, with_qp=with_qp)
    for _ in range(100):
        y, reference, w, state = law_inputs(mpc, rng)
        state[6:] *= 10 ** rng.uniform(-1, 1)
        u, after, *_ = law(y, 10 ** rng.uniform(-1, 2) * reference, w, state)
        u = u.full().ravel()
        assert np.allclose(4 * after.full().ravel()[6:9], u, rtol=0, atol=1e-14)  # what is applied is predicted with
        before = np.clip(4 * state[6:9], -4, 4)
        change = u - before
        assert np.abs(u).max() <= 4
        assert (change >= 0.05 * np.array([-20, -np.inf, -5]) - 1e-12).all()
        assert (change <= 0.05 * np.array([10, 30, np.inf]) + 1e-12).all()
        limited += (np.abs(u) < 4).any()
    assert limited > 30


def wrong_solver(name, shape):
    """A solver that is off by a thousandth and says nothing."""
    right = qp_solver(name, shape)
    given = right.mx_in()
    z, multipliers = right(*given)
    return casadi.Function("qp", given, [z + 1e-3, multipliers])


class GivesUp(casadi.Callback):
    """A solver that solves until it is told to raise, and then raises for good."""

    made: list["GivesUp"]

    def __init__(self, name, shape):
        casadi.Callback.__init__(self)
        self.right, self.spent = qp_solver(name, shape), False
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
        assert np.allclose(u, expected(y, np.tile(wanted, 10), (), state)[0].full().ravel(), rtol=0, atol=1e-12)
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
    assert np.allclose(u, expected(y, np.tile(wanted, 10), (), state)[0].full().ravel(), rtol=0, atol=1e-12)
    assert (controller.info.steps, controller.info.clipped) == (2, 1)
    controller.step(y, wanted)
    assert (controller.info.steps, controller.info.clipped) == (3, 1)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("size", [1e6, 1e30, 1e200, 1e308])
def test_absurd_measurements_and_references_leave_the_inputs_inside_their_bounds(name, size, capfd):
    controller = replace(TIGHT, backend=name).controller(THETA)
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
