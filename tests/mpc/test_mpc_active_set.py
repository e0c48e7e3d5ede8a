"""The active-set solver in C by itself and inside the controller: closed forms, warm starts, caps, contradictions."""

import ctypes
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.codegen import c_compiler, shared_library
from socasadi.mpc import KKT_TOLERANCE, ActiveSet, DualProgram, control_law, controller_sources, rest_state

pytestmark = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")

OPTIMAL, INFEASIBLE, CAPPED = 0, 1, 2
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
TIGHT = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=(-0.03, 0.03))

HARNESS = """
#include "qp.h"

void in_turn(int rows, int cap, const real *tables, int calls, const real *centres, real *values, real *multipliers,
             int *status, int *iterations) {
    real reals[QP_REALS(rows)];
    int ints[QP_INTS(rows)], t, i;
    const qp_problem problem = {rows, cap, tables + 5 * rows, tables, tables + rows, tables + 2 * rows,
                                tables + 3 * rows, tables + 4 * rows};
    qp self;
    qp_init(&self, &problem, reals, ints);
    for (t = 0; t < calls; ++t) {
        status[t] = qp_solve(&self, centres + t * rows);
        iterations[t] = self.iterations;
        for (i = 0; i < rows; ++i) {
            values[t * rows + i] = self.value[i];
            multipliers[t * rows + i] = self.multiplier[i];
        }
    }
}

double residual(int rows, const real *tables, const real *centre, const real *multipliers) {
    real reals[QP_REALS(rows)];
    int ints[QP_INTS(rows)], i;
    const qp_problem problem = {rows, 1, tables + 5 * rows, tables, tables + rows, tables + 2 * rows,
                                tables + 3 * rows, tables + 4 * rows};
    qp self;
    qp_init(&self, &problem, reals, ints);
    for (i = 0; i < rows; ++i) self.multiplier[i] = multipliers[i];
    return (double)qp_residual(&self, centre);
}
"""


class Rows(NamedTuple):
    """A program as its rows see it, gram + softness being 1 on the diagonal."""

    gram: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    softness: np.ndarray
    price: np.ndarray
    unit: np.ndarray


class Solved(NamedTuple):
    values: np.ndarray
    multipliers: np.ndarray
    status: np.ndarray
    iterations: np.ndarray


@pytest.fixture(scope="module")
def c():
    sources = {**controller_sources(), "harness.c": HARNESS}
    library = ctypes.CDLL(str(shared_library("qp-harness", sources, flags=("-std=c99", "-ffp-contract=off"))))
    library.residual.restype = ctypes.c_double
    return library


def given(program: Rows) -> ctypes.Array:
    """What the harness reads: lower, upper, softness, price, unit, gram's lower triangle."""
    triangle = program.gram[np.tril_indices(len(program.lower))]
    bounds = (np.clip(bound, -1e30, 1e30) for bound in (program.lower, program.upper))
    flat = np.concatenate([*bounds, program.softness, program.price, program.unit, triangle])
    return (ctypes.c_double * len(flat))(*flat)


def in_turn(c, program: Rows, centres, cap: int = 1000) -> Solved:
    """One solver for programs of these centres (T, rows), one after the other."""
    centres = np.ascontiguousarray(centres, dtype=float)
    told = np.zeros((2, len(centres)), np.intc)
    answers = np.zeros((2, *centres.shape))
    number, integer = (ctypes.POINTER(kind) for kind in (ctypes.c_double, ctypes.c_int))
    c.in_turn(
        len(program.lower),
        cap,
        given(program),
        len(centres),
        centres.ctypes.data_as(number),
        *(answer.ctypes.data_as(number) for answer in answers),
        *(count.ctypes.data_as(integer) for count in told),
    )
    return Solved(*answers, *told)


def from_scratch(c, program: Rows, centres, cap: int = 1000) -> Solved:
    """A new solver for each."""
    each = [in_turn(c, program, centre[None], cap) for centre in np.asarray(centres)]
    return Solved(*(np.concatenate(parts) for parts in zip(*each, strict=True)))


def scaled(directions, lower, upper, softness, price) -> Rows:
    """Of a unit Hessian, with rows of any length: scaled to what the solver takes."""
    gram = directions @ directions.T
    unit = np.sqrt(np.diag(gram) + softness)
    return Rows(gram / np.outer(unit, unit), lower / unit, upper / unit, softness / unit**2, price * unit, unit)


def one_row(softness: float, price: float) -> Rows:
    """min (z - centre)^2 / (2 gram) with -1 <= z <= 2."""
    return Rows(*(np.array(part) for part in ([[1 - softness]], [-1.0], [2.0], [softness], [price], [1.0])))


def random_rows(rng, rows=12, variables=5) -> Rows:
    """Feasible at 0. A third of the rows is soft, a third soft with a price."""
    kind = rng.integers(0, 3, rows)
    return scaled(
        rng.normal(size=(rows, variables)),
        np.where(rng.random(rows) < 0.1, -np.inf, -rng.uniform(0.1, 1, rows)),
        rng.uniform(0.1, 1, rows),
        np.where(kind > 0, 10 ** rng.uniform(-3, 0, rows), 0.0),
        np.where(kind == 2, rng.uniform(0.1, 2, rows), 0.0),
    )


def repeated_rows(rng) -> Rows:
    """Every row of six three times: as it is, with other bounds, and turned round."""
    once, sign = random_rows(rng, 6, 4), np.repeat([1.0, 1.0, -1.0], 6)
    lower, upper = np.tile(once.lower, 3), np.tile(once.upper, 3)
    lower[12:], upper[12:] = -once.upper, -once.lower
    upper[6:12] *= 1.5
    gram = np.tile(once.gram, (3, 3)) * np.outer(sign, sign)
    return Rows(gram, lower, upper, np.tile(once.softness, 3), np.tile(once.price, 3), np.tile(once.unit, 3))


def centres_of(rng, program: Rows, count: int):
    """Values that some unconstrained optimum gives the rows: a walk, that jumps, and stays now and then."""
    root = np.linalg.svd(program.gram)
    reached = root[0][:, root[1] > 1e-9] * np.sqrt(root[1][root[1] > 1e-9])
    walk, point = [], np.zeros(reached.shape[1])
    for t in range(count):
        if t % 7 == 6:
            point = 10 ** rng.uniform(-1, 1.5) * rng.normal(size=len(point))
        elif t % 7 < 5:
            point = point + 0.3 * rng.normal(size=len(point))
        walk.append(reached @ point)
    return np.array(walk)


def broken(program: Rows, centre, multipliers) -> float:
    """By how much the optimality conditions are, in scaled rows. Only the right answer leaves none of them broken."""
    values = centre - program.gram @ multipliers
    beyond = np.where(multipliers > 0, values - program.upper, program.lower - values)
    slack = program.softness * np.maximum(np.abs(multipliers) - program.price, 0)
    outside = np.maximum(np.maximum(values - program.upper, program.lower - values), 0)
    return np.where(multipliers == 0, outside, np.abs(beyond - slack)).max()


EXCESSES = [-40.0, -5.0, -3.0, -1.7, -1.2, -1.0, -0.3, 0.0, 1.9, 2.0, 2.1, 2.2, 2.5, 2.9, 3.6, 20.0]


@pytest.mark.parametrize("price", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("softness", [1e-4, 0.1, 0.6])
def test_a_soft_row_is_kept_up_to_its_price_and_gives_way_beyond_it(c, softness, price):
    """One dimension: a multiplier m moves the row by gram m, so that an excess up to gram price is met by the price
    alone; beyond, m = price + (excess - gram price) / (gram + softness), and softness (m - price) of it stays."""
    rng = np.random.default_rng(0)
    gram, order = 1 - softness, np.r_[EXCESSES, EXCESSES[::-1], rng.choice(EXCESSES, 200)]
    answer = in_turn(c, one_row(softness, price), order[:, None])
    for centre, value, multiplier in zip(order, answer.values[:, 0], answer.multipliers[:, 0], strict=True):
        bound, side = (2.0, 1) if centre > 0 else (-1.0, -1)
        excess = max(side * (centre - bound), 0)
        size = excess / gram if excess <= gram * price else price + (excess - gram * price) / (gram + softness)
        left = softness * max(size - price, 0)
        assert multiplier == pytest.approx(side * size, rel=1e-9, abs=1e-9)
        assert value == pytest.approx(bound + side * left if excess else centre, rel=1e-10, abs=1e-10)
    assert (answer.status == OPTIMAL).all()


def test_a_hard_row_is_kept_to_ten_digits_however_little_it_is_exceeded(c):
    excess = 10.0 ** np.arange(-13, 3)
    for side, bound in ((1, 2.0), (-1, -1.0)):
        answer = in_turn(c, one_row(0.0, 0.0), (bound + side * excess)[:, None])
        assert np.abs(answer.values - bound).max() < 1e-10
        assert (side * answer.multipliers >= 0).all()


@pytest.mark.parametrize("make", [random_rows, repeated_rows])
@pytest.mark.parametrize("seed", range(8))
def test_where_a_solution_starts_from_never_changes_it(c, make, seed):
    rng = np.random.default_rng(seed)
    program = make(rng)
    centres = centres_of(rng, program, 150)
    warm, cold = in_turn(c, program, centres), from_scratch(c, program, centres)
    assert (warm.status == OPTIMAL).all()
    assert (cold.status == OPTIMAL).all()
    size = np.abs(centres).max(axis=1, keepdims=True) + 1
    assert np.abs((warm.values - cold.values) / size).max() < 1e-9
    for centre, multipliers, scale in zip(centres, warm.multipliers, size, strict=True):
        assert broken(program, centre, multipliers) < 1e-9 * scale
    active = np.count_nonzero(warm.multipliers, axis=1)
    assert active.min() <= 2 < 4 <= active.max()


@pytest.mark.parametrize("seed", range(4))
def test_a_program_that_has_not_changed_takes_no_iteration_and_one_that_hardly_has_takes_few(c, seed):
    rng = np.random.default_rng(seed)
    program = random_rows(rng)
    centre = centres_of(rng, program, 7)[6]
    centre *= 10 / np.abs(centre).max()
    again = in_turn(c, program, np.tile(centre, (5, 1)))
    assert again.iterations[0] > 0
    assert (again.iterations[1:] == 0).all()
    near = centre * (1 + 0.01 * rng.normal(size=(60, 1)))
    assert in_turn(c, program, near).iterations.sum() < 0.3 * from_scratch(c, program, near).iterations.sum()


def test_infeasible_is_said_and_the_next_program_is_solved_right(c):
    """Row 2 is the sum of rows 0 and 1 and is to exceed the sum of their upper bounds, which no centre allows; without
    its lower bound all is well. Of the very rows, it is the centre that makes a program infeasible where row 3, a
    direction that no variable moves, has its value given."""
    rng, told = np.random.default_rng(1), 0
    for _ in range(40):
        directions = rng.normal(size=(8, 5))
        directions[2], directions[3] = directions[0] + directions[1], 0
        lower, upper = -rng.uniform(0.1, 1, 8), rng.uniform(0.1, 1, 8)
        unit = np.sqrt((directions**2).sum(axis=1))
        unit[3] = 1.0
        gram = directions @ directions.T / np.outer(unit, unit)
        program = Rows(gram, lower / unit, upper / unit, np.zeros(8), np.zeros(8), unit)
        point = 3 * rng.normal(size=(12, 5))
        centres = point @ directions.T / unit
        centres[::2, 3] = rng.choice([-2.0, 2.0], 6)
        answer = in_turn(c, program, centres)
        assert (answer.status == np.where(np.arange(12) % 2, OPTIMAL, INFEASIBLE)).all()
        right = from_scratch(c, program, centres[1::2])
        assert np.allclose(answer.values[1::2], right.values, rtol=0, atol=1e-9 * np.abs(centres).max())
        for centre, multipliers in zip(centres[1::2], answer.multipliers[1::2], strict=True):
            assert broken(program, centre, multipliers) < 1e-9 * np.abs(centres).max()

        lower[2] = upper[0] + upper[1] + 10 ** rng.uniform(-3, 1)
        upper[2] = np.inf
        contrary = program._replace(lower=lower / unit, upper=upper / unit)
        answer = in_turn(c, contrary, np.where(np.arange(8) == 3, 0.0, centres))
        assert (answer.status == INFEASIBLE).all()
        assert answer.iterations.max() <= 40
        told += 12
    assert told == 480


def test_programs_of_other_variables_are_solved_right_after_a_contradiction():
    """The same by way of Python, where the program is infeasible by its parameter alone."""
    directions = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    # The third row is z1 + z2 - p: with z1, z2 <= 1, that it is at least 0 asks for p <= 2.
    unit = np.array([1.0, 1.0, np.sqrt(2)])
    dual = DualProgram(
        map=np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0]]) / unit[:, None],
        gram=directions @ directions.T / np.outer(unit, unit),
        lower=np.array([-1.0, -1.0, 0.0]) / unit,
        upper=np.array([1.0, 1.0, np.inf]) / unit,
        softness=np.zeros(3),
        price=np.zeros(3),
        unit=unit,
    )
    solver = ActiveSet(dual)
    for p in (1.0, 3.0, 1.5, 2.5, 4.0, 0.5, -1.0, 2.0):
        answer = solver.solve(np.array([p, 1.0]))
        if p > 2:
            assert answer.residual > 0.1
        else:
            assert answer.residual < 1e-9
            # The least z1^2 + z2^2 on z1 + z2 >= p.
            assert np.allclose(answer.values, [max(p, 0) / 2, max(p, 0) / 2, max(p, 0) - p], rtol=0, atol=1e-9)
            assert np.allclose(answer.multipliers, [0, 0, -max(p, 0) / 2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("angle", [1e-2, 3e-4, 3e-5])
def test_rows_that_nearly_coincide_are_told_apart(c, angle):
    """z1 = 0 and z1 cos(angle) + z2 sin(angle) = sin(angle) meet in (0, 1)."""
    directions = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)], [0.0, 1.0]])
    bounds = np.array([0.0, np.sin(angle)])
    program = scaled(directions, np.r_[bounds, -np.inf], np.r_[bounds, np.inf], np.zeros(3), np.zeros(3))
    answer = in_turn(c, program, (np.array([[0.5, -0.3], [2.0, 3.0]]) @ directions.T))
    assert (answer.status == OPTIMAL).all()
    assert np.allclose(answer.values[:, 2], 1, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_rows_that_are_all_the_same_end_within_the_cap_that_controllers_have(c, seed):
    """Twenty hard ones, or soft ones, which together are as one of twenty times the weight."""
    rng, rows = np.random.default_rng(seed), 20
    for softness in (0.0, 0.2):
        gram, bound = 1 - softness, rng.uniform(0.5, 2)
        same = np.ones(rows)
        program = Rows(gram * np.ones((rows, rows)), -bound * same, bound * same, softness * same, 0 * same, same)
        centres = rng.uniform(-9, 9, 50)
        answer = in_turn(c, program, np.outer(centres, same), cap=50 + 2 * rows)
        assert (answer.status == OPTIMAL).all()
        excess = np.maximum(np.abs(centres) - bound, 0)
        left = excess * softness / (softness + rows * gram)
        right = np.sign(centres) * np.where(excess > 0, bound + left, np.abs(centres))
        assert np.allclose(answer.values, right[:, None], rtol=0, atol=1e-10)


def test_so_do_rows_that_all_meet_in_the_answer(c):
    rng = np.random.default_rng(0)
    for _ in range(50):
        directions, vertex = rng.normal(size=(30, 4)), rng.normal(size=4)
        program = scaled(directions, np.full(30, -np.inf), directions @ vertex, np.zeros(30), np.zeros(30))
        push = rng.uniform(0, 3, (5, 30)) * (rng.random((5, 30)) < 0.5)
        centres = ((vertex + push @ directions) @ directions.T) / program.unit
        answer = in_turn(c, program, centres, cap=50 + 2 * 30)
        assert (answer.status == OPTIMAL).all()
        assert np.allclose(answer.values, program.upper, rtol=0, atol=1e-9 * np.abs(centres).max())


def test_as_many_iterations_are_allowed_as_the_cap_says_and_none_more(c):
    """What takes n of them is solved with a cap of n, and is told to be capped with one less."""
    rng, counts = np.random.default_rng(2), set()
    for _ in range(40):
        program = random_rows(rng)
        centre = centres_of(rng, program, 7)[6:]
        free = in_turn(c, program, centre)
        needed = int(free.iterations[0])
        counts.add(needed)
        for cap in range(needed + 2):
            capped = in_turn(c, program, centre, cap)
            if cap >= needed:
                assert capped.status[0] == OPTIMAL
                assert capped.iterations[0] == needed
                assert np.array_equal(capped.values, free.values)
            else:
                assert capped.status[0] == CAPPED
                assert capped.iterations[0] == cap
                assert broken(program, centre[0], capped.multipliers[0]) > 1e-9
    assert len(counts) > 4


@pytest.mark.parametrize("cap", range(6))
def test_from_any_working_set_the_cap_holds_and_what_is_called_optimal_is(c, cap):
    rng, counts = np.random.default_rng(10), np.zeros(3, int)
    for _ in range(10):
        program = random_rows(rng)
        centres = centres_of(rng, program, 100)
        answer = in_turn(c, program, centres, cap)
        counts += np.bincount(answer.status, minlength=3)
        assert (answer.iterations <= cap).all()
        assert (answer.iterations[answer.status == CAPPED] == cap).all()
        for t in np.flatnonzero(answer.status == OPTIMAL):
            assert broken(program, centres[t], answer.multipliers[t]) < 1e-9 * (1 + np.abs(centres[t]).max())
    assert counts[INFEASIBLE] == 0
    assert counts[CAPPED] > 10
    assert counts[OPTIMAL] > 10


def test_one_row_takes_one_iteration_and_one_more_where_it_turns_soft_at_its_price(c):
    centres = np.array([[1.0], [4.0], [40.0], [40.0], [4.0], [0.0]])
    hard, soft, priced = (
        from_scratch(c, one_row(*kind), centres).iterations.tolist() for kind in ((0.0, 0.0), (0.5, 0.0), (0.5, 6.0))
    )
    assert hard == soft == [0, 1, 1, 1, 1, 0]
    assert priced == [0, 1, 2, 2, 1, 0]
    # From the working set of the one before: joins, turns, stays, turns back, leaves.
    assert in_turn(c, one_row(0.5, 6.0), centres).iterations.tolist() == [0, 1, 1, 0, 1, 1]
    assert in_turn(c, one_row(0.5, 0.0), centres).iterations.tolist() == [0, 1, 0, 0, 0, 1]
    assert in_turn(c, one_row(0.0, 0.0), centres).iterations.tolist() == [0, 1, 0, 0, 0, 1]


@pytest.mark.parametrize("hole", [np.nan, 1e308, -1e308])
def test_after_centres_that_are_no_numbers_the_next_answer_is_right(hole):
    """10 times 1e308 is infinite."""
    rng = np.random.default_rng(3)
    of_rows = random_rows(rng)
    dual = DualProgram(map=10 * np.eye(12), **of_rows._asdict())
    solver = ActiveSet(dual)
    for centre in centres_of(rng, of_rows, 40):
        spoilt = np.where(rng.random(12) < 0.3, hole, centre)
        spoilt[rng.integers(12)] = hole
        with np.errstate(over="ignore"):
            assert not solver.solve(spoilt).residual <= KKT_TOLERANCE
        right, answer = ActiveSet(dual).solve(centre), solver.solve(centre)
        assert np.array_equal(answer.values, right.values)
        assert (answer.iterations, answer.residual) == (right.iterations, right.residual)


def test_solvers_side_by_side_do_not_disturb_each_other():
    rng = np.random.default_rng(4)
    programs = [random_rows(rng), repeated_rows(rng)]
    programs.append(programs[0])
    tasks = [(DualProgram(map=np.eye(len(p.lower)), **p._asdict()), centres_of(rng, p, 40)) for p in programs]
    solvers = [ActiveSet(dual) for dual, _ in tasks]
    together = [[] for _ in tasks]
    for t in range(40):
        for solver, (_, centres), answers in zip(solvers, tasks, together, strict=True):
            answers.append(solver.solve(centres[t]))
    for (dual, centres), answers in zip(tasks, together, strict=True):
        alone = ActiveSet(dual)
        for centre, answer in zip(centres, answers, strict=True):
            again = alone.solve(centre)
            assert np.array_equal(again.values, answer.values)
            assert np.array_equal(again.multipliers, answer.multipliers)
            assert (again.iterations, again.residual) == (answer.iterations, answer.residual)


def test_forgetting_starts_anew():
    rng = np.random.default_rng(5)
    of_rows = random_rows(rng)
    dual = DualProgram(map=np.eye(12), **of_rows._asdict())
    solver = ActiveSet(dual)
    for centre in centres_of(rng, of_rows, 30):
        solver.solve(centre)
        solver.forget()
        right, answer = ActiveSet(dual).solve(centre), solver.solve(centre)
        assert np.array_equal(right.multipliers, answer.multipliers)
        assert right.iterations == answer.iterations


SPOILT = {
    # Of min (z - centre)^2 / (2 gram), -1 <= z <= 2 in a scaled row, 1 of which is 0.5 in its own unit.
    # softness, price, centre, multiplier, and how far off the row then is, in its own unit.
    "above the upper bound": (0.0, 0.0, 2.4, 0.0, 0.2),
    "below the lower bound": (0.0, 0.0, -1.4, 0.0, 0.2),
    "pushed further in than to the bound": (0.0, 0.0, 3.0, 1.4, 0.2),
    "pushed less than to the bound": (0.0, 0.0, 3.0, 0.6, 0.2),
    "pushed away from a lower bound that is not reached": (0.0, 0.0, 0.0, -0.4, 0.7),
    "held by more than the price without giving way": (0.5, 1.0, 3.0, 2.0, 0.25),
    "giving way at less than the price": (0.5, 1.0, 3.0, 0.8, 0.3),
    "giving way too little for its multiplier": (0.5, 0.0, 3.0, 1.2, 0.1),
    "the same at the lower bound": (0.5, 0.0, -2.0, -1.2, 0.1),
    "nothing": (0.5, 0.0, 3.0, 1.0, 0.0),
    "nothing, beyond the price": (0.5, 1.0, 3.5, 2.0, 0.0),
    "nothing, inside": (0.5, 1.0, 1.9, 0.0, 0.0),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_the_residual_is_how_far_off_the_worst_row_is_in_its_own_unit(c, kind):
    """Beside a row in which all is well, before it and behind it."""
    softness, price, centre, multiplier, off = SPOILT[kind]
    fine = np.eye(3)
    fine[1, 1] = 1 - softness
    program = Rows(
        fine,
        np.array([-1.0, -1.0, -1.0]),
        np.array([2.0, 2.0, 2.0]),
        np.array([0.0, softness, 0.0]),
        np.array([0.0, price, 0.0]),
        np.array([1.0, 0.5, 1.0]),
    )
    number = ctypes.c_double * 3
    residual = c.residual(3, given(program), number(1.0, centre, 3.0), number(0.0, multiplier, 1.0))
    assert residual == pytest.approx(off, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_not_finite_has_the_largest_residual_there_is(c, hole):
    """So has what overflows on the way to a row's own unit."""
    program = random_rows(np.random.default_rng(0), 3, 3)
    program = program._replace(unit=np.full(3, 1e10 if hole == 1e300 else 1.0))
    number, largest = ctypes.c_double * 3, np.finfo(float).max
    for i in range(3):
        spoilt = [0.0, 0.0, 0.0]
        spoilt[i] = hole
        assert c.residual(3, given(program), number(*spoilt), number(0, 0, 0)) == largest
        assert c.residual(3, given(program), number(0, 0, 0), number(*spoilt)) == largest


def random_sample(rng, mpc):
    """Tensions before, a measurement and a reference that ask for more than the bounds give, often enough."""
    held, y = rng.uniform(*mpc.input_limits), rng.uniform(-0.06, 0.06, 2)
    return held, y, rng.uniform(-0.08, 0.08, 2) + rng.uniform(-0.02, 0.02, (mpc.reference_rows, 2))


@pytest.mark.parametrize("price", [0.0, 100.0])
def test_along_the_programs_of_a_controller_the_start_changes_nothing_either(price):
    mpc = replace(TIGHT, slack_linear=price, rate_bounds=(-60, 60))
    design = mpc.design(SYSTEM)
    rng, warm, cold = np.random.default_rng(6), ActiveSet(design.dual), ActiveSet(design.dual)
    parameters, active, spared = np.r_[np.zeros(design.dual.map.shape[1] - 1), 1.0], 0, 0
    for t in range(300):
        # Jumps, and a walk between them.
        change = 0.05 * rng.normal(size=len(parameters) - 1)
        parameters[:-1] = change if t % 10 == 0 else parameters[:-1] + 0.05 * change
        cold.forget()
        one, other = warm.solve(parameters), cold.solve(parameters)
        assert max(one.residual, other.residual) < 1e-9
        assert np.abs(one.values - other.values).max() < 1e-9
        active += np.count_nonzero(one.multipliers)
        spared += other.iterations - one.iterations
    assert active > 300
    assert spared > 100


@pytest.mark.parametrize("cap", [1, 2])
def test_a_cap_that_is_met_yields_the_clipped_law_and_no_wrong_answer(cap):
    free, capped = TIGHT.controller_for(SYSTEM), TIGHT.controller_for(SYSTEM)
    capped._data.qp.iterations = cap  # pyright: ignore[reportAttributeAccessIssue]
    law, rng = control_law(TIGHT, free.design, with_qp=False), np.random.default_rng(7)
    met = 0
    for _ in range(200):
        size = 10 ** rng.uniform(-1, 0.3)
        held, y, reference = (size * part for part in random_sample(rng, TIGHT))
        for controller in (free, capped):
            controller.reset(held)
        right, u = free.step(y, reference), capped.step(y, reference)
        if free.info.iterations <= cap:
            assert (capped.info.status, capped.info.iterations) == (0, free.info.iterations)
            assert np.array_equal(u, right)
        else:
            met += 1
            clipped = law(y, reference.ravel(), (), rest_state(TIGHT, free.design, held))[0].full().ravel()
            assert capped.info.status == 1
            assert capped.info.iterations == cap
            assert (capped.info.clipped, capped.info.held, capped.info.worst_residual) == (1, 0, 0.0)
            assert capped.info.residual > KKT_TOLERANCE
            assert np.allclose(u, clipped, rtol=0, atol=1e-12)
    assert 20 < met < 180


def test_after_a_reference_that_overflows_the_next_input_is_right():
    both = [replace(TIGHT, backend=name).controller_for(SYSTEM) for name in ("active-set", "daqp")]
    rng, spoilt = np.random.default_rng(8), 0
    for t in range(60):
        _, y, reference = random_sample(rng, TIGHT)
        if t % 3 == 1:
            reference[:] = rng.choice([-1, 1], 2) * 1e308
        one, other = (controller.step(0.3 * y, reference) for controller in both)
        assert np.allclose(one, other, rtol=0, atol=1e-6)
        spoilt += both[0].info.status == 2
        assert both[0].info.status in ((0,), (1, 2))[t % 3 == 1]
        assert both[0].info.steps == t + 1
    assert spoilt == both[0].info.held > 5
    assert both[0].info.worst_residual < KKT_TOLERANCE


def test_controllers_side_by_side_do_not_disturb_each_other():
    specifications = [TIGHT, replace(TIGHT, slack_linear=100.0, delay=2, rate_bounds=(-60, 60)), TIGHT]

    def samples(k):
        rng = np.random.default_rng(k)
        return [random_sample(rng, specifications[k])[1:] for _ in range(40)]

    together = [mpc.controller_for(SYSTEM) for mpc in specifications]
    inputs = [[] for _ in specifications]
    for each in zip(*map(samples, range(3)), strict=True):
        for controller, sample, answers in zip(together, each, inputs, strict=True):
            answers.append(controller.step(*sample))
    for k, mpc in enumerate(specifications):
        alone = mpc.controller_for(SYSTEM)
        assert np.array_equal([alone.step(*sample) for sample in samples(k)], inputs[k])
        assert alone.info == together[k].info


@pytest.mark.parametrize(
    "settings", [{}, {"rate_bounds": (-60, 60)}, {"slack_linear": 100.0}, {"input_bounds": (0, 10)}]
)
def test_single_precision_follows_double_within_a_ten_thousandth_of_the_bound(settings):
    """On a hundred ordinary problems, one after the other and each from rest."""
    mpc = replace(LinearMPC(Modal(), output_bounds=(-0.05, 0.05)), **settings)
    pair = [mpc.controller_for(SYSTEM, real=real) for real in ("double", "float")]
    rng, at_bound = np.random.default_rng(9), 0
    for t in range(100):
        held, y, reference = random_sample(rng, mpc)
        if t % 2:
            for controller in pair:
                controller.reset(held)
        exact, rounded = (controller.step(y, reference) for controller in pair)
        assert np.abs(rounded - exact).max() < 1e-4 * mpc.input_scale.min()
        assert pair[1].info.status == 0
        at_bound += np.isclose(exact, mpc.input_limits, rtol=0, atol=1e-9).any()
    assert at_bound > 20
