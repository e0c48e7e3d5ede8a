import ctypes
import importlib.util
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from socasadi.codegen import c_compiler
from socasadi.export import ExportError
from socasadi.export.osqp import OsqpSources, osqp_adapter, write_osqp
from socasadi.mpc import __file__ as mpc

with_osqp = pytest.mark.skipif(importlib.util.find_spec("osqp") is None, reason="no code generator: pip install osqp")
with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
HEADERS = Path(mpc).parent / "c"

DRIVER = """
#include "qp.h"
#include "table.h"
static const qp_problem problem = {ROWS, 1000, gram, lower, upper, softness, price, unit};
static const qp_problem other = {ROWS - 1, 1000, gram, lower, upper, softness, price, unit};
static real reals[QP_REALS(ROWS)];
static int ints[QP_INTS(ROWS)];
static qp solver;
void start(int which) { qp_init(&solver, which ? &other : &problem, reals, ints); }
void reset(void) { qp_reset(&solver); }
int solve(const real *centre, real *value, real *multiplier, real *residual, int *iterations) {
    const int status = qp_solve(&solver, centre);
    int i;
    *iterations = solver.iterations;
    *residual = qp_residual(&solver, centre);
    for (i = 0; i < ROWS; ++i) {
        value[i] = solver.value[i];
        multiplier[i] = solver.multiplier[i];
    }
    return status;
}
"""
OPTIMAL, INFEASIBLE, CAPPED = 0, 1, 2


@dataclass(frozen=True)
class Tracking:
    """Tracking with a random model as a program over the moves: inputs and their rates are hard, outputs soft rows."""

    hessian: np.ndarray
    rows: np.ndarray
    softness: np.ndarray
    price: np.ndarray
    bound: np.ndarray
    unit: np.ndarray
    centres: np.ndarray

    @property
    def gram(self) -> np.ndarray:
        return self.rows @ np.linalg.solve(self.hessian, self.rows.T)


def tracking(seed: int, price: float, *, horizon: int = 8, samples: int = 120, weight: float = 100.0) -> Tracking:
    """References jump beyond the outputs' bounds, and the state is thrown, so that bounds of all kinds are active."""
    random = np.random.default_rng(seed)
    order, inputs, outputs = 4, 2, 2
    A = random.normal(size=(order, order))
    A *= 0.95 / np.abs(np.linalg.eigvals(A)).max()
    B, C = random.normal(size=(order, inputs)), random.normal(size=(outputs, order))
    C /= np.linalg.norm(C @ np.linalg.solve(np.eye(order) - A, B), 2)
    free = np.vstack([C @ np.linalg.matrix_power(A, k + 1) for k in range(horizon)])
    forced = np.zeros((horizon * outputs, horizon * inputs))
    for k in range(horizon):
        for j in range(k + 1):
            block = C @ np.linalg.matrix_power(A, k - j) @ B
            forced[outputs * k : outputs * (k + 1), inputs * j : inputs * (j + 1)] = block
    moves = horizon * inputs
    hessian = 10.0 * forced.T @ forced + np.eye(moves)
    own = np.vstack([np.eye(moves), np.eye(moves) - np.eye(moves, k=-inputs), forced])
    bound = np.concatenate([np.ones(moves), np.full(moves, 0.5), np.full(horizon * outputs, 0.3)])
    soft = np.concatenate([np.zeros(2 * moves), np.full(horizon * outputs, 1 / weight)])
    linear = np.concatenate([np.zeros(2 * moves), np.full(horizon * outputs, price)])
    unit = np.sqrt(np.einsum("ij,ji->i", own, np.linalg.solve(hessian, own.T)) + soft)
    state, before, reference, centres = np.zeros(order), np.zeros(inputs), np.zeros(outputs), []
    for sample in range(samples):
        if sample % 10 == 0:
            reference = 0.5 * random.normal(size=outputs)
        if sample % 25 == 0:
            state = state + 0.5 * random.normal(size=order)
        best = -np.linalg.solve(hessian, 10.0 * forced.T @ (free @ state - np.tile(reference, horizon)))
        offset = np.concatenate([np.zeros(moves), -before, np.zeros(moves - inputs), free @ state])
        centres.append((own @ best + offset) / unit)
        before = np.clip(best[:inputs], np.maximum(before - 0.5, -1), np.minimum(before + 0.5, 1))
        state = A @ state + B @ before
    scaled = own / unit[:, None]
    return Tracking(hessian, scaled, soft / unit**2, linear * unit, bound / unit, unit, np.array(centres))


def by_daqp(program: Tracking) -> np.ndarray:
    """The rows' values at the optimum, from the primal in moves and two slacks for every soft row."""
    soft = np.flatnonzero(program.softness)
    moves, count = program.hessian.shape[0], len(soft)
    slack = np.zeros((len(program.rows), count))
    slack[soft, np.arange(count)] = 1.0
    cost = np.tile(1 / program.softness[soft], 2)
    hessian = ca.sparsify(ca.diagcat(program.hessian, ca.diag(cost)))
    rows = ca.DM(np.hstack([program.rows, -slack, slack]))
    solver = ca.conic("qp", "daqp", {"h": hessian.sparsity(), "a": rows.sparsity()})
    linear = np.concatenate([np.zeros(moves), np.tile(program.price[soft], 2)])
    lowest = np.concatenate([np.full(moves, -np.inf), np.zeros(2 * count)])
    values = []
    for centre in program.centres:
        bounds = {"lba": -program.bound - centre, "uba": program.bound - centre, "lbx": lowest}
        change = solver(h=hessian, g=linear, a=rows, **bounds)["x"].full().ravel()[:moves]
        assert solver.stats()["success"]
        values.append(centre + program.rows @ change)
    return np.array(values)


class Compiled:
    """The adapter on OSQP's generated code, built as a shared library."""

    def __init__(self, program: Tracking, folder: Path, real: str):
        self.type = np.float32 if real == "float" else np.float64
        self.rows = len(program.rows)
        self.written = write(program, folder, real)
        compiled(folder, self.written, ["-fPIC", *flags(real)], ["-shared", "-o", "qp.so"])
        self.library = ctypes.CDLL(str(folder / "qp.so"))
        self.library.start(0)

    def solve(self, centre: np.ndarray) -> tuple[int, np.ndarray, np.ndarray, float]:
        centre = np.ascontiguousarray(centre, self.type)
        value, multiplier, residual = np.zeros_like(centre), np.zeros_like(centre), np.zeros(1, self.type)
        iterations = np.zeros(1, np.intc)
        given = [array.ctypes.data_as(ctypes.c_void_p) for array in (centre, value, multiplier, residual, iterations)]
        status = self.library.solve(*given)
        return status, value.astype(float), multiplier.astype(float), float(residual[0])


def flags(real: str) -> list[str]:
    return ["-DREAL_FLOAT"] if real == "float" else []


def write(program: Tracking, folder: Path, real: str) -> OsqpSources:
    folder.mkdir(parents=True, exist_ok=True)
    written = write_osqp(program.hessian, program.rows, program.softness, program.price, folder, real=real)
    suffix = "f" if real == "float" else ""
    tables = {
        "gram": program.gram[np.tril_indices(len(program.rows))],
        "lower": -program.bound,
        "upper": program.bound,
        "softness": program.softness,
        "price": program.price,
        "unit": program.unit,
    }
    lines = [f"#define ROWS {len(program.rows)}"]
    for name, values in tables.items():
        lines.append(
            f"static const real {name}[] = {{{', '.join(f'{value!r}{suffix}' for value in values.tolist())}}};"
        )
    (folder / "table.h").write_text("\n".join(lines))
    for file in ("real.h", "qp.h", "qp_residual.c"):
        (folder / file).write_text((HEADERS / file).read_text())
    (folder / "qp.c").write_text(osqp_adapter())
    (folder / "driver.c").write_text(DRIVER)
    return written


def compiled(folder: Path, written: OsqpSources, options: Sequence[str], link: Sequence[str]) -> None:
    compiler = [*(c_compiler() or []), "-std=c99", "-O1", *options, *(f"-I{include}" for include in written.includes)]
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    subprocess.run([*compiler, *strict, "-c", "qp.c", "qp_residual.c"], cwd=folder, check=True)
    subprocess.run([*compiler, "-w", "-c", "driver.c", *written.sources], cwd=folder, check=True)
    objects = [f"{Path(source).stem}.o" for source in ("qp.c", "qp_residual.c", "driver.c", *written.sources)]
    subprocess.run([*(c_compiler() or []), *objects, *link], cwd=folder, check=True)


@pytest.fixture(scope="module")
def example(tmp_path_factory) -> tuple[Tracking, Compiled]:
    program = tracking(0, price=0.5)
    return program, Compiled(program, tmp_path_factory.mktemp("osqp"), "double")


@with_osqp
@with_compiler
@pytest.mark.parametrize(("real", "tolerance", "believed"), [("double", 1e-7, 1e-6), ("float", 1e-3, 1e-4)])
@pytest.mark.parametrize(("seed", "price"), [(1, 0.0), (2, 0.5), (3, 5.0)])
def test_the_generated_code_finds_the_optimum_of_random_tracking_problems(
    tmp_path, real, tolerance, believed, seed, price
):
    program = tracking(seed, price)
    expected, generated = by_daqp(program), Compiled(program, tmp_path, real)
    answers = [generated.solve(centre) for centre in program.centres]
    beyond = np.abs(expected) > program.bound * (1 + 1e-6)
    assert beyond[:, program.softness > 0].any(axis=1).mean() > 0.05  # outputs had to exceed their bounds
    assert np.mean([np.count_nonzero(multiplier) > 0 for _, _, multiplier, _ in answers]) > 0.2
    passed = np.array([status == OPTIMAL and residual <= believed for status, _, _, residual in answers])
    assert passed.mean() >= 0.98
    off = np.abs(np.array([value for _, value, _, _ in answers]) - expected) * program.unit
    assert off[passed].max() < tolerance


@with_osqp
@with_compiler
def test_the_residual_is_that_of_the_multipliers(example):
    program, generated = example
    for centre in program.centres[:20]:
        _, value, multiplier, residual = generated.solve(centre)
        np.testing.assert_allclose(value, centre - program.gram @ multiplier, atol=1e-12)
        exceeds = program.softness * np.maximum(np.abs(multiplier) - program.price, 0.0)
        target = np.sign(multiplier) * (program.bound + exceeds)
        off = np.where(multiplier == 0, np.maximum(np.abs(value) - program.bound, 0.0), np.abs(value - target))
        assert residual == pytest.approx((off * program.unit).max(), abs=1e-13)


@with_osqp
@with_compiler
def test_after_a_reset_the_answers_are_those_of_the_beginning_to_the_last_bit(example):
    program, generated = example
    generated.library.reset()
    first = [generated.solve(centre) for centre in program.centres[:10]]
    generated.library.reset()
    for before, centre in zip(first, program.centres[:10], strict=True):
        again = generated.solve(centre)
        assert again[0] == before[0]
        np.testing.assert_array_equal(again[1], before[1])


@with_osqp
@with_compiler
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_what_is_not_a_number_or_enormous_leaves_no_trace(example, value):
    program, generated = example
    spoiled = program.centres[30].copy()
    spoiled[3] = value
    status, _, _, residual = generated.solve(spoiled)
    assert status != OPTIMAL or residual < np.inf
    status, _, _, residual = generated.solve(program.centres[30])
    assert status == OPTIMAL
    assert residual < 1e-6


@with_osqp
@with_compiler
def test_tables_of_another_shape_are_not_solved(example):
    program, generated = example
    generated.library.start(1)
    assert generated.solve(program.centres[0])[0] == CAPPED
    generated.library.start(0)
    assert generated.solve(program.centres[0])[0] == OPTIMAL


@with_osqp
@with_compiler
def test_nothing_is_allocated_or_printed(example, tmp_path):
    program, _ = example
    written = write(program, tmp_path, "double")
    compiled(tmp_path, written, [], ["-r", "-nostdlib", "-o", "whole.o"])
    listed = subprocess.run(["nm", "-u", "whole.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    needed = {line.split()[-1] for line in listed.splitlines()} - {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    assert needed <= {"memset", "memcpy", "memmove"}


@with_osqp
@with_compiler
def test_code_for_one_type_does_not_compile_for_the_other(example, tmp_path, capfd):
    program, _ = example
    for real, other in (("double", "float"), ("float", "double")):
        written = write(program, tmp_path / real, real)
        with pytest.raises(subprocess.CalledProcessError):
            compiled(tmp_path / real, written, flags(other), [])
        assert f"was generated for {real}" in capfd.readouterr().err


@with_osqp
def test_it_is_written_silently_completely_and_the_same_each_time(tmp_path, capfd):
    program = tracking(0, price=0.5)
    given = (program.hessian, program.rows, program.softness, program.price)
    written = write_osqp(*given, tmp_path / "a")
    (tmp_path / "b" / "osqp").mkdir(parents=True)
    (tmp_path / "b" / "osqp" / "left.c").write_text("of an earlier export")
    write_osqp(*given, tmp_path / "b")
    files = {str(file.relative_to(tmp_path / "a")) for file in (tmp_path / "a").rglob("*") if file.is_file()}
    assert files == {*written.sources, *written.headers, written.licence}
    assert files == {str(file.relative_to(tmp_path / "b")) for file in (tmp_path / "b").rglob("*") if file.is_file()}
    assert all((tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes() for file in files)
    assert "Apache License" in (tmp_path / "a" / written.licence).read_text()
    assert capfd.readouterr() == ("", "")


def test_without_the_package_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "osqp", None)
    program = tracking(0, price=0.0, samples=1)
    with pytest.raises(ExportError, match="pip install osqp"):
        write_osqp(program.hessian, program.rows, program.softness, program.price, tmp_path)
    assert not (tmp_path / "osqp").exists()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rows": np.ones((2, 3))}, r"hessian is \(2, 2\), but the rows have 3 columns"),
        ({"price": np.zeros(3)}, r"price is \(3,\), but there are 2 rows"),
        ({"rows": 2 * np.eye(2)}, "row 0 is not scaled: .* is 4 there, not 1"),
        ({"real": "half"}, "real='half' is unknown"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(tmp_path, change, sentence):
    given = {"hessian": np.eye(2), "rows": np.eye(2), "softness": np.zeros(2), "price": np.zeros(2)}
    with pytest.raises(ValueError, match=sentence):
        write_osqp(**{**given, "folder": tmp_path, **change})
