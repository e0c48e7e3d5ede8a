"""A comparison flies each cell once, keeps what it has, and tells what came out."""

import json
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from baselines_support import THETA, LinearPlant, study
from comparison_support import Better, comparison

from socasadi import Circle, ClosedLoopStability, Overshoot, Pulse
from socasadi.baselines import (
    DeadCable,
    Lab,
    Method,
    Summary,
    fitting_cells,
    fly_cell,
    load_comparison,
    run_comparison,
    stored_cells,
    worth,
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


class Here(Executor):
    """Does at once what it is given, and counts it."""

    def __init__(self) -> None:
        self.done = 0

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.done += 1
        future.set_result(fn(*args, **kwargs))
        return future


def test_what_counts_at_a_checkpoint_is_the_last_controller_before_it():
    cell = fly_cell(comparison(), "circle", "better", 0)
    first, second, third = cell["points"]
    poor = worth(comparison().of("circle", 0), next(Better().offers(Lab(comparison().of("circle", 0), (6.0,)))), 2)[0]
    assert first["J"] == pytest.approx(poor.J, rel=1e-6)
    assert (first["spent"], second["spent"], third["spent"]) == (0.0, 12.0, 12.0)
    assert max(second["J"]) < min(first["J"])
    assert second["failure"] is None
    assert second == third
    assert cell["flights"] == 2
    assert json.loads(json.dumps(cell, allow_nan=False)) == cell


def test_a_method_that_breaks_keeps_what_it_had_and_one_without_a_controller_has_nothing():
    broken = fly_cell(comparison(), "circle", "broken", 0)
    assert broken["broke"].startswith("ArithmeticError: it does not add up (comparison_support.py, line ")
    assert all(point["J"] for point in broken["points"])
    never = fly_cell(comparison(), "circle", "never", 0)
    assert never["points"] == [None, None, None]
    assert never["broke"] is None


def test_what_is_no_controller_breaks_the_method_off_and_not_the_comparison():
    @dataclass(frozen=True)
    class Forgetful(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            yield None  # pyright: ignore[reportReturnType]

    cell = fly_cell(comparison(methods={"forgetful": Forgetful()}), "circle", "forgetful", 0)
    assert "TypeError: offers yields controllers, which have mpc, info, reset, step; not None" in cell["broke"]


def test_a_controller_that_is_changed_after_it_was_offered_is_not_taken_for_two():
    @dataclass(frozen=True)
    class Reusing(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            pilot = lab.study.mpc.controller(THETA)
            yield pilot
            lab.fly(pilot)
            yield pilot

    cell = fly_cell(comparison(methods={"reusing": Reusing()}), "circle", "reusing", 0)
    assert "the same controller twice" in cell["broke"]
    assert cell["points"][0]["spent"] == cell["points"][-1]["spent"] == 0.0


def test_a_controller_that_breaks_when_it_is_judged_breaks_its_method_off():
    class Silent:
        """It flies, but what it predicts it cannot say."""

        def __init__(self, pilot):
            self.mpc, self.info, self.reset, self.step = pilot.mpc, pilot.info, pilot.reset, pilot.step

        def prediction_error(self, record):
            raise IndexError("no such sample")

    @dataclass(frozen=True)
    class Faulty(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            yield Silent(lab.study.mpc.controller(THETA))

    cell = fly_cell(comparison(methods={"faulty": Faulty()}), "circle", "faulty", 0)
    assert cell["broke"].startswith("IndexError: no such sample (test_baselines_compare.py, line ")
    assert all(point["J"] for point in cell["points"])  # what was flown is kept


def test_a_plant_of_which_a_task_differs_is_not_known():
    @dataclass(frozen=True)
    class Reads(Method):
        def offers(self, lab: Lab) -> Iterator[Pilot]:
            seen.append((lab.known, lab.study.plant))
            yield from ()

    seen: list = []
    other = LinearPlant()
    made = comparison(methods={"reads": Reads()}, tasks={"another": study(other)})
    fly_cell(made, "another", "reads", 0)
    assert seen == [(made.study.plant, other)]


def test_a_failed_flight_is_null_and_counts_as_infinite():
    class Torn(LinearPlant):
        def step(self, tension, tip_force=None):
            if np.abs(tension).max() > 1:
                raise RuntimeError("a cable tore")
            return super().step(tension)

    made = comparison(study=study(Torn()))
    cell = fly_cell(made, "circle", "better", 0)
    assert cell["points"][-1]["J"] == [None, None]
    assert "a cable tore" in cell["points"][-1]["failure"]
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


def test_a_method_of_ones_own_that_was_edited_or_broke_off_is_flown_again(tmp_path):
    own = """
from socasadi.baselines import Law, Method

GAIN = 0.0

class Holding(Law):
    def begin(self):
        pass

    def act(self, y, reference):
        return GAIN + 0 * self.held

class Mine(Method):
    def offers(self, lab):
        yield Holding(lab.study.mpc)
"""
    (script := tmp_path / "script.py").write_text(
        own + SCRIPT.replace('"identified": Identified(6.0)', '"own": Mine()')
    )
    run_comparison(script, "full", tmp_path / "out", first := Here())
    run_comparison(script, "full", tmp_path / "out", again := Here())
    assert (first.done, again.done) == (8, 0)
    for old, new in (
        ("GAIN = 0.0", "GAIN = 1.0"),
        ("GAIN + 0", "GAIN + 2"),
        ("yield Holding", "raise ValueError; Holding"),
    ):
        script.write_text(script.read_text().replace(old, new))
        run_comparison(script, "full", tmp_path / "out", edited := Here())
        assert edited.done == 4
    cells = run_comparison(script, "full", tmp_path / "out", broken := Here())
    assert broken.done == 4
    line = script.read_text().splitlines().index("        raise ValueError; Holding(lab.study.mpc)") + 1
    assert sum(cell["broke"] == f"ValueError:  (script.py, line {line})" for cell in cells) == 4


def test_a_part_that_is_flown_by_itself_leaves_the_others_in_the_folder(tmp_path):
    (script := tmp_path / "script.py").write_text(SCRIPT)
    run_comparison(script, "full", tmp_path, Here())
    script.write_text(SCRIPT.replace("Identified(6.0)", "Identified(5.0)"))
    assert len(run_comparison(script, "full", tmp_path, Here(), methods=["identified"], seeds=1)) == 2
    flown = fitting_cells(load_comparison(script), tmp_path)
    assert sorted((cell["method"], cell["seed"]) for cell in flown) == [
        ("identified", 0), ("identified", 0), ("ours", 0), ("ours", 0), ("ours", 1), ("ours", 1),
    ]  # fmt: skip


def test_workers_that_know_an_older_script_are_not_believed(tmp_path):
    class Stale(Here):
        def submit(self, fn, /, *args, **kwargs):
            return super().submit(fn, str(old), *args[1:], **kwargs)

    (old := tmp_path / "old.py").write_text(SCRIPT)
    (script := tmp_path / "script.py").write_text(SCRIPT.replace("Identified(6.0)", "Identified(5.0)"))
    with pytest.raises(RunError, match=r"script\.py, or what it imports, was edited"):
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
    late = Circle(duration=4.0, pulse=Pulse(time=3.0, duration=0.5, force=(0.0, 1.0, 0.0)))
    short = comparison(tasks={"late": late}).of_size("smoke").of("late", 0).task
    assert (short.duration, short.pulse) == (4.0, None)
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
    with pytest.raises(ValueError, match="the first 3 seeds are asked for, of 2"):
        comparison(seeds=(0, 1)).of_parts(seeds=3)
    assert some.digest("circle", "never", 0) == comparison().digest("circle", "never", 0)
    two = {"circle": Circle(), "small": Circle(radius=0.01)}
    robust = comparison(tasks=two, elsewhere={"dead": DeadCable()}, elsewhere_on=("circle",))
    assert not robust.of_parts(tasks=["small"]).elsewhere
    assert robust.of_parts(tasks=["circle"]).elsewhere == robust.elsewhere


@pytest.mark.parametrize(
    ("changes", "error", "fault"),
    [
        ({"methods": {}}, TypeError, "at least one method"),
        ({"checkpoints": (3, 2)}, ValueError, "ascend"),
        ({"checkpoints": (1.5, 2)}, ValueError, r"whole numbers from 1 on, not \[1.5, 2\]"),
        ({"checkpoints": ()}, TypeError, r"not \(\)"),
        ({"seeds": (0, 0)}, ValueError, r"different whole numbers from 0 on, not \[0, 0\]"),
        ({"seeds": 3}, TypeError, "seeds are several whole numbers, not 3"),
        ({"flights": 0}, ValueError, "at least 1 of each controller, not 0"),
        ({"study": 3}, TypeError, "study is a Study, not 3"),
        ({"tasks": [Circle()]}, TypeError, "tasks are a dictionary"),
        ({"tasks": {"circle": 0.03}}, TypeError, "0.03 is given as the task 'circle'; an instance of Task"),
        ({"tasks": {"a/b": Circle()}}, ValueError, "'a/b' gives files their names"),
        ({"elsewhere": {"dead": 3}}, TypeError, "'dead' is 3"),
        ({"elsewhere": [DeadCable()]}, TypeError, "elsewhere is a dictionary"),
        ({"elsewhere": {"dead": DeadCable()}}, ValueError, "elsewhere_on no task"),
        ({"elsewhere_on": "circle"}, TypeError, "names of tasks, not 'circle'"),
        ({"shown": ("best",)}, ValueError, "shown names 'best'; the methods are better, broken, never"),
        ({"shown": "better"}, TypeError, "shown are names of methods, not 'better'"),
        ({"elsewhere_on": None}, TypeError, "names of tasks, not None"),
        ({"tasks": {1: Circle()}}, ValueError, "the task 1 gives files their names"),
        ({"study": replace(study(), conditions=(ClosedLoopStability(),))}, ValueError, "the study has conditions"),
        ({"tasks": {"x": replace(study(), limits=(Overshoot(0.1),))}}, ValueError, "the study has limits"),
        ({"methods": {"x": Better}}, TypeError, "Better'> is given as the method 'x'; an instance of Method"),
        ({"elsewhere_on": ("square",)}, ValueError, "'square'; the tasks are circle"),
    ],
)
def test_a_comparison_that_makes_no_sense_is_refused(changes, error, fault):
    with pytest.raises(error, match=fault):
        comparison(**changes)


def test_another_robot_that_cannot_be_is_found_before_anything_is_flown(tmp_path):
    for others, fault in (
        ("DeadCable(9)", "no 'cable dead' of the robot of the task 'circle': there is no cable 9"),
        ("lambda plant: None", "is no plant, but None"),
    ):
        (script := tmp_path / "script.py").write_text(SCRIPT.replace("DeadCable(1)", others))
        with pytest.raises(RunError, match=fault):
            run_comparison(script, "full", tmp_path / "out", executor := Here())
        assert executor.done == 0


def test_a_script_without_a_comparison_says_what_to_write(tmp_path):
    (script := tmp_path / "script.py").write_text("study = 1")
    with pytest.raises(RunError, match="defines no `comparison`"):
        load_comparison(Path(script))
