"""A comparison flies each cell once, keeps what it has, and tells what came out."""

import json
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from baselines_support import THETA, LinearPlant, rod_study, study

from socasadi import Circle
from socasadi.baselines import (
    Comparison,
    DeadCable,
    Delayed,
    Lab,
    Loaded,
    Method,
    Misrouted,
    Noisier,
    Rubbing,
    Softer,
    Summary,
    fly_cell,
    load_comparison,
    run_comparison,
    stored_cells,
    summary_table,
)
from socasadi.campaign import Pilot, RunError

SCRIPT = """
from baselines_support import study
from socasadi import Circle
from socasadi.baselines import Comparison, DeadCable, Identified, ModelSearch

comparison = Comparison(
    study=study(),
    tasks={"circle": Circle(radius=0.03, duration=3.0), "small": Circle(radius=0.01, duration=3.0)},
    methods={"ours": ModelSearch(), "identified": Identified(6.0)},
    seeds=(0, 1),
    checkpoints=(1, 3),
    flights=1,
    elsewhere={"cable dead": DeadCable(1)},
    elsewhere_on=("circle",),
)
"""


@dataclass(frozen=True)
class Never(Method):
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield from ()


@dataclass(frozen=True)
class Broken(Method):
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        yield lab.study.mpc.controller(THETA)
        lab.fly(lab.study.mpc.controller(THETA))
        raise ArithmeticError("it does not add up")


@dataclass(frozen=True)
class Better(Method):
    """A poor controller at once, and the true one after two flights."""

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        poor = lab.study.mpc.controller(THETA * np.where(np.arange(10) % 5 >= 2, 0.5, 1.0))
        yield poor
        lab.fly(poor)
        lab.fly(poor)
        yield lab.study.mpc.controller(THETA)


class Here(Executor):
    """Does at once what it is given, and counts it."""

    def __init__(self) -> None:
        self.done = 0

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.done += 1
        future.set_result(fn(*args, **kwargs))
        return future


def comparison(**changes):
    made = {
        "study": study(LinearPlant(noise=1e-3)),
        "tasks": {"circle": Circle(radius=0.03, period=6.0, duration=6.0)},
        "methods": {"better": Better(), "broken": Broken(), "never": Never()},
        "seeds": (0,),
        "checkpoints": (1, 2, 3),
        "flights": 2,
    }
    return Comparison(**made | changes)


def test_what_counts_at_a_checkpoint_is_the_last_controller_before_it():
    cell = fly_cell(comparison(), "circle", "better", 0)
    first, second, third = cell["points"]
    assert first["J"] == pytest.approx(first["J"])
    assert (first["spent"], second["spent"], third["spent"]) == (0.0, 12.0, 12.0)
    assert max(second["J"]) < min(first["J"])
    assert second == third
    assert cell["flights"] == 2
    assert json.loads(json.dumps(cell, allow_nan=False)) == cell


def test_a_method_that_breaks_keeps_what_it_had_and_one_without_a_controller_has_nothing():
    broken = fly_cell(comparison(), "circle", "broken", 0)
    assert broken["broke"] == "ArithmeticError: it does not add up"
    assert all(point["J"] for point in broken["points"])
    never = fly_cell(comparison(), "circle", "never", 0)
    assert never["points"] == [None, None, None]
    assert never["broke"] is None


def test_a_failed_flight_is_null_and_counts_as_infinite():
    class Torn(LinearPlant):
        def step(self, tension, tip_force=None):
            if np.abs(tension).max() > 1:
                raise RuntimeError("a cable tore")
            return super().step(tension)

    made = comparison(study=study(Torn()))
    cell = fly_cell(made, "circle", "better", 0)
    assert cell["points"][-1]["J"] == [None, None]
    summary = Summary.of([cell], ["circle"], ["better"])
    assert summary.values("circle", "better", "J") == [np.inf]


def test_cells_are_kept_and_only_what_is_missing_or_changed_is_flown(tmp_path):
    (script := tmp_path / "script.py").write_text(SCRIPT)
    told, executor, out = [], Here(), tmp_path / "out"
    cells = run_comparison(script, "full", out, executor, lambda _, done, total: told.append((done, total)))
    assert executor.done == len(cells) == 8
    assert told[-1] == (8, 8)
    again = Here()
    same = run_comparison(script, "full", out, again)
    assert again.done == 0
    assert sorted(map(str, same)) == sorted(map(str, cells))
    # A full disk cut the last cell off, and of one method the settings are others.
    kept = out / "cells.jsonl"
    kept.write_bytes(kept.read_bytes()[:-100])
    of_lost = cells[-1]["method"] == "identified"
    script.write_text(SCRIPT.replace("Identified(6.0)", "Identified(5.0)"))
    some = Here()
    changed = run_comparison(script, "full", out, some)
    assert some.done == 4 + (not of_lost)
    assert len(list(stored_cells(out))) == 7 + some.done  # what is written after a torn line is not lost with it
    # Settings that were flown before are known again.
    script.write_text(SCRIPT)
    assert len(changed) == len(run_comparison(script, "full", out, some)) == 8
    assert some.done == 5


def test_workers_that_know_an_older_script_are_not_believed(tmp_path):
    class Stale(Here):
        def submit(self, fn, /, *args, **kwargs):
            return super().submit(fn, str(old), *args[1:], **kwargs)

    (old := tmp_path / "old.py").write_text(SCRIPT)
    (script := tmp_path / "script.py").write_text(SCRIPT.replace("Identified(6.0)", "Identified(5.0)"))
    with pytest.raises(RunError, match=r"a worker knows another script\.py"):
        run_comparison(script, "full", tmp_path / "out", Stale())


def test_a_cell_whose_worker_dies_is_flown_again_and_one_that_kills_them_ends_the_comparison_in_a_sentence(tmp_path):
    class Mortal(Here):
        def __init__(self, deaths):
            super().__init__()
            self.deaths = deaths

        def submit(self, fn, /, *args, **kwargs):
            if self.deaths and args[3] == "identified":
                self.deaths -= 1
                future: Future = Future()
                future.set_exception(BrokenExecutor("signal 9"))
                return future
            return super().submit(fn, *args, **kwargs)

    (script := tmp_path / "script.py").write_text(SCRIPT)
    assert len(run_comparison(script, "full", tmp_path / "some", Mortal(2))) == 8
    with pytest.raises(RunError, match=r"identified, \d: its workers die \(signal 9\)"):
        run_comparison(script, "full", tmp_path / "all", Mortal(99))


def test_when_nobody_takes_a_cell_any_more_what_was_done_is_stored(tmp_path):
    class Gone(Here):
        def submit(self, fn, /, *args, **kwargs):
            if self.done == 3:
                raise BrokenExecutor("its scheduler is gone")
            return super().submit(fn, *args, **kwargs)

    (script := tmp_path / "script.py").write_text(SCRIPT)
    with pytest.raises(RunError, match=r"nobody takes more cells \(its scheduler is gone\); what was done is stored"):
        run_comparison(script, "full", tmp_path / "out", Gone())
    assert len(list(stored_cells(tmp_path / "out"))) == 3


def test_what_is_not_installed_is_no_result_of_a_method():
    @dataclass(frozen=True)
    class Lacking(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            yield from ()
            raise ModuleNotFoundError("No module named 'x'; pip install x")

    with pytest.raises(ModuleNotFoundError, match="pip install x"):
        fly_cell(comparison(methods={"lacking": Lacking()}), "circle", "lacking", 0)


def test_a_size_is_less_of_the_same():
    whole = comparison(seeds=tuple(range(10)), checkpoints=(1, 10, 30, 110), flights=5)
    assert whole.of_size("full") is whole
    quick = whole.of_size("quick")
    assert (quick.seeds, quick.checkpoints, quick.flights) == ((0, 1, 2), (1, 10, 30), 3)
    smoke = whole.of_size("smoke")
    assert (smoke.seeds, smoke.checkpoints) == ((0,), (1, 10))
    assert smoke.of("circle", 0).task.duration == 5.0
    with pytest.raises(ValueError, match="smoke, quick, full"):
        whole.of_size("huge")


def test_some_of_its_parts_are_flown_by_themselves():
    some = comparison().of_parts(methods=["never", "better"])
    assert list(some.methods) == ["better", "never"]
    assert list(some.tasks) == ["circle"]
    assert list(comparison().of_parts().methods) == ["better", "broken", "never"]
    assert comparison(seeds=(3, 1, 2)).of_parts(seeds=2).seeds == (3, 1)
    with pytest.raises(ValueError, match="no task 'square'; there are circle"):
        comparison().of_parts(tasks=["square"])
    with pytest.raises(ValueError, match="2 seeds, of which the first 3 cannot be taken"):
        comparison(seeds=(0, 1)).of_parts(seeds=3)
    assert some.digest("circle", "never", 0) == comparison().digest("circle", "never", 0)


@pytest.mark.parametrize(
    ("changes", "error", "fault"),
    [
        ({"methods": {}}, TypeError, "at least one method"),
        ({"checkpoints": (3, 2)}, ValueError, "ascend"),
        ({"methods": {"x": Better}}, TypeError, "'x' is a Method"),
        ({"elsewhere_on": ("square",)}, ValueError, "'square'; the tasks are circle"),
    ],
)
def test_a_comparison_that_makes_no_sense_is_refused(changes, error, fault):
    with pytest.raises(error, match=fault):
        comparison(**changes)


def test_a_script_without_a_comparison_says_what_to_write(tmp_path):
    (script := tmp_path / "script.py").write_text("study = 1")
    with pytest.raises(RunError, match="defines no `comparison`"):
        load_comparison(Path(script))


def made_up(costs):
    """Cells of two methods, costs by method as (tasks, seeds)."""
    point = {"rmse": [1e-3], "settled": 1e-3, "violated": 0.0, "effort": 0.1, "solve": [1e-5] * 3, "spent": 20.0}
    return [
        {
            "task": f"task {i}",
            "method": method,
            "seed": seed,
            "information": "data sheet",
            "checkpoints": [30],
            "points": [point | {"J": [J]}],
            "elsewhere": {},
            "open_loop": None,
            "flights": 30,
            "failed": 1,
        }
        for method, rows in costs.items()
        for i, row in enumerate(rows)
        for seed, J in enumerate(row)
    ]


def test_a_rival_is_beaten_task_by_task_and_by_a_rank_test():
    def rivalry(ours, theirs):
        tasks = [f"task {i}" for i in range(len(ours))]
        return Summary.of(made_up({"ours": ours, "theirs": theirs}), tasks, ["ours", "theirs"]).rivalry("theirs")

    theirs = np.exp(np.random.default_rng(0).standard_normal((3, 8)))
    won, tasks, p = rivalry(theirs * np.linspace(0.8, 0.95, 24).reshape(3, 8), theirs)
    assert (won, tasks) == (3, 3)
    assert p == pytest.approx(2 * 0.5**24)  # all 24 differences have one sign, and none is like another
    assert rivalry(theirs, theirs[:, ::-1])[2] > 0.05
    assert np.isnan(rivalry([[1.0]], [[2.0]])[2])


def test_the_table_has_a_row_for_each_task_and_method():
    summary = Summary.of(made_up({"ours": [[2.0, 4.0, np.inf]]}), ["task 0"], ["ours", "absent"])
    (row,) = summary_table(summary)
    assert (row["J"], row["RMSE / mm"], row["failed"], row["open loop / mm"]) == ("4", "1", "3 of 90", "-")


def test_other_robots_differ_in_what_they_say():
    made = rod_study()
    plant, tension = made.plant, np.array([6.0, 0.0, 0.0])

    def moved(robot, samples=60):
        robot.reset(seed=0)
        for _ in range(samples):
            robot.step(tension)
        return np.array(robot.true_output)

    own = moved(plant)
    still = moved(plant, 900)
    assert moved(Softer(young=0.8)(plant), 900)[0] == pytest.approx(still[0] / 0.8, rel=0.02)
    assert moved(Misrouted(1.2)(plant), 900)[0] == pytest.approx(1.2 * still[0], rel=0.02)
    assert moved(Rubbing(0.3)(plant), 900)[0] < still[0]
    np.testing.assert_allclose(moved(DeadCable(0)(plant)), 0, atol=1e-9)
    np.testing.assert_allclose(moved(Delayed(1)(plant), 61), own, atol=1e-12)
    assert moved(Loaded(0.1)(plant), 8)[0] < moved(plant, 8)[0]
    assert Noisier(3.0)(plant).noise == pytest.approx(3 * plant.noise)
    # Damping does not move where it comes to rest.
    np.testing.assert_allclose(moved(Softer(damping=1.2)(plant), 900), still, atol=1e-6)
    assert replace(made, plant=Delayed(1)(plant)).plant.outputs == 2
