"""The active-set solver in C by itself: closed forms, warm starts, caps, contradictions."""

import ctypes
from typing import NamedTuple

import numpy as np
import pytest

from socasadi.codegen import c_compiler, shared_library
from socasadi.mpc import (
    KKT_TOLERANCE,
    ActiveSet,
    DualProgram,
    controller_sources,
)
from socasadi.mpc.formulation import dual_program

pytestmark = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")


OPTIMAL, INFEASIBLE, CAPPED = 0, 1, 2


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


def harness(real: str = "double") -> ctypes.CDLL:
    flags = ("-std=c99", "-ffp-contract=off", *(["-DREAL_FLOAT"] if real == "float" else []))
    library = ctypes.CDLL(
        str(shared_library("qp-harness", {**controller_sources(), "harness.c": HARNESS}, flags=flags))
    )
    library.residual.restype = ctypes.c_double
    return library


@pytest.fixture(scope="module")
def c():
    return harness()


def given(program: Rows, real: type = float) -> np.ndarray:
    """What the harness reads: lower, upper, softness, price, unit, gram's lower triangle."""
    triangle = program.gram[np.tril_indices(len(program.lower))]
    bounds = (np.clip(bound, -1e30, 1e30) for bound in (program.lower, program.upper))
    return np.concatenate([*bounds, program.softness, program.price, program.unit, triangle]).astype(real)


def in_turn(c, program: Rows, centres, cap: int = 1000, real: type = float) -> Solved:
    """One solver for programs of these centres (T, rows), one after the other."""
    centres = np.ascontiguousarray(centres, dtype=real)
    told = np.zeros((2, len(centres)), np.intc)
    answers = np.zeros((2, *centres.shape), real)
    arrays = [given(program, real), centres, *answers, *told]
    tables, points, values, multipliers, status, iterations = (
        array.ctypes.data_as(ctypes.c_void_p) for array in arrays
    )
    c.in_turn(len(program.lower), cap, tables, len(centres), points, values, multipliers, status, iterations)
    return Solved(*answers, *told)


def residual_of(c, program: Rows, centre, multipliers) -> float:
    arrays = [given(program), np.array(centre, dtype=float), np.array(multipliers, dtype=float)]
    return c.residual(len(program.lower), *(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))


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


def test_single_precision_says_infeasible_as_well():
    """Row 3 is a positive combination of the three before and is to exceed what they allow by half its length."""
    c, rng = harness("float"), np.random.default_rng(14)
    for _ in range(100):
        directions, weights = rng.normal(size=(6, 5)), rng.uniform(0.2, 1, 3)
        directions[3] = weights @ directions[:3]
        upper = rng.uniform(0.1, 1, 6)
        lower = np.r_[-upper[:3], weights @ upper[:3] + 0.5 * np.linalg.norm(directions[3]), -upper[4:]]
        program = scaled(directions, lower, np.where(np.arange(6) == 3, np.inf, upper), np.zeros(6), np.zeros(6))
        centres = rng.normal(size=(4, 5)) @ directions.T / program.unit
        answer = in_turn(c, program, centres, real=np.float32)
        assert (answer.status == INFEASIBLE).all()
        assert answer.iterations.max() < 30


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


@pytest.mark.parametrize("cap", range(1, 7))
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


@pytest.mark.parametrize("seed", range(4))
def test_rows_that_have_nothing_to_do_with_each_other_change_one_by_one_and_once_each(c, seed):
    """From inside to at the bound to beyond it and back again, a soft row without a price straight to beyond it; by way
    of the inside from one bound to the other."""
    rng, rows = np.random.default_rng(seed), 30
    softness = np.repeat([0.0, 0.3, 0.3], 10)
    price = np.r_[np.zeros(20), rng.uniform(0.5, 2, 10)]
    program = Rows(np.diag(1 - softness), -np.ones(rows), np.ones(rows), softness, price, np.ones(rows))
    centres = rng.uniform(-4, 4, (40, rows)) * (rng.random((40, rows)) < 0.8)
    answer = in_turn(c, program, centres)
    excess = np.maximum(np.abs(centres) - 1, 0)
    steps = np.where(excess == 0, 0, np.where((price > 0) & (excess > (1 - softness) * price), 2, 1))
    steps = steps * np.sign(centres).astype(int)
    expected = np.abs(np.diff(steps, axis=0, prepend=0)).sum(axis=1)
    assert np.array_equal(answer.iterations, expected)
    assert (answer.status == OPTIMAL).all()


@pytest.mark.parametrize("make", [random_rows, repeated_rows])
def test_single_precision_solves_the_same_programs_to_four_digits(make):
    """Each from where the one before ended, within the cap that controllers have, rows repeated or not."""
    rng = np.random.default_rng(11)
    for _ in range(15):
        of_rows = make(rng)
        dual = DualProgram(map=np.eye(len(of_rows.lower)), **of_rows._asdict())
        single, double = ActiveSet(dual, "float"), ActiveSet(dual)
        for centre in centres_of(rng, of_rows, 40):
            rounded, exact = single.solve(centre), double.solve(centre)
            off = np.abs(rounded.values - exact.values) / of_rows.unit
            assert off.max() < 1e-4 * (1 + np.abs(centre).max())


@pytest.mark.parametrize("angle", [0.3, 0.03])
def test_single_precision_tells_rows_apart_that_are_two_degrees_apart(angle):
    """As above, rows that meet in (0, 1)."""
    directions = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)], [0.0, 1.0]])
    bounds = np.array([0.0, np.sin(angle)])
    program = scaled(directions, np.r_[bounds, -9.0], np.r_[bounds, 9.0], np.zeros(3), np.zeros(3))
    solver = ActiveSet(DualProgram(map=directions, **program._asdict()), "float")
    for point in ([0.5, -0.3], [2.0, 3.0], [-1.0, 0.0]):
        assert np.allclose(solver.solve(np.array(point)).values, [0, np.sin(angle), 1], rtol=0, atol=1e-3)


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
    # softness, price, centre, multiplier, and how far the row then is, in its own unit, from the proximal point that
    # its multiplier asks for.
    "above the upper bound": (0.0, 0.0, 2.4, 0.0, 0.2),
    "below the lower bound": (0.0, 0.0, -1.4, 0.0, 0.2),
    "pushed further in than to the bound": (0.0, 0.0, 3.0, 1.4, 0.2),
    "pushed less than to the bound": (0.0, 0.0, 3.0, 0.6, 0.2),
    "pushed away from a lower bound that is not reached": (0.0, 0.0, 0.0, -0.4, 0.2),
    "held by more than the price without giving way": (0.5, 1.0, 3.0, 2.0, 0.125),
    "giving way at less than the price": (0.5, 1.0, 3.0, 0.8, 0.175),
    "giving way too little for its multiplier": (0.5, 0.0, 3.0, 1.2, 0.05),
    "the same at the lower bound": (0.5, 0.0, -2.0, -1.2, 0.05),
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
    residual = residual_of(c, program, [1.0, centre, 3.0], [0.0, multiplier, 1.0])
    # Where the row is out of a hard bound, or short of it, nobody can measure otherwise; elsewhere by what measure the
    # residual is taken is left open, within reason.
    reason = 1 if (softness == 0 and centre > 2) or multiplier == 0 else 4
    assert off * (1 - 1e-12) <= residual <= reason * off * (1 + 1e-12) + 1e-15


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_not_finite_has_the_largest_residual_there_is(c, hole):
    """So has what overflows on the way to a row's own unit."""
    program = random_rows(np.random.default_rng(0), 3, 3)
    program = program._replace(unit=np.full(3, 1e10 if hole == 1e300 else 1.0))
    largest = np.finfo(float).max
    for i in range(3):
        spoilt = [0.0, 0.0, 0.0]
        spoilt[i] = hole
        assert residual_of(c, program, spoilt, [0, 0, 0]) == largest
        assert residual_of(c, program, [0, 0, 0], spoilt) == largest


@pytest.mark.parametrize("factor", [1e3, 1e6, 1e9])
def test_a_program_a_million_times_as_large_has_an_answer_a_million_times_as_large(c, factor):
    """Bounds, prices and centres are; so are values and multipliers. Rows repeated and meeting in a point included."""
    rng = np.random.default_rng(13)
    for make in (random_rows, repeated_rows):
        for _ in range(20):
            once = make(rng)
            large = once._replace(lower=factor * once.lower, upper=factor * once.upper, price=factor * once.price)
            centres = centres_of(rng, once, 20)
            small, answer = in_turn(c, once, centres), in_turn(c, large, factor * centres)
            assert (answer.status == OPTIMAL).all()
            scale = 1 + np.abs(centres).max(axis=1, keepdims=True)
            assert np.abs((answer.values / factor - small.values) / scale).max() < 1e-9
            assert answer.iterations.max() < 50 + 2 * len(once.lower)


def test_a_row_without_bounds_is_never_off_whatever_its_unit(c):
    endless = np.full(2, np.inf)
    program = Rows(np.eye(2), -endless, endless, np.zeros(2), np.zeros(2), np.array([1e290, 1e-290]))
    assert residual_of(c, program, [3.0, -5.0], [0.0, 0.0]) == 0


def test_a_hard_row_that_nothing_moves_binds_nothing_and_is_off_by_what_it_exceeds():
    """z >= 1 beside a value that is the parameter itself, between -2 and 2."""
    one, none = np.ones(2), np.zeros((1, 1))
    dual = dual_program(
        np.eye(1),
        none,
        np.array([[1.0], [0.0]]),
        np.array([[0.0], [1.0]]),
        one * [1, -2],
        one * 2,
        one * np.inf,
        0 * one,
    )
    for value, off in ((0.5, 0.0), (2.0, 0.0), (2.75, 0.75), (-3.0, 1.0), (1.0, 0.0)):
        answer = ActiveSet(dual).solve(np.array([value]))
        assert np.array_equal(answer.values, [1.0 if not off else answer.values[0], value])
        assert answer.residual == pytest.approx(off, abs=1e-15) or (off and answer.residual >= off)


def test_a_row_without_bounds_is_free_however_far_it_goes():
    endless, none = np.full(1, np.inf), np.zeros(1)
    dual = DualProgram(np.eye(1), np.eye(1), -endless, endless, none, none, np.ones(1))
    for real in ("double", "float"):
        for centre in (-1e6, 1e6, 1e9):
            answer = ActiveSet(dual, real).solve(np.array([centre]))
            assert answer == (centre, 0.0, 0.0, 0)
