"""A method of one's own whose code was edited, wherever it stands, is another one."""

import subprocess
import sys

import pytest

from socasadi.baselines import Lab, load_comparison

SCRIPT = """
from dataclasses import dataclass, field, replace
from functools import partial, wraps

import numpy as np
import beside
from baselines_support import study
from socasadi.baselines import Comparison, IterativeLearning, Law, Method, tuned
from socasadi.model import Entry

SHARES = [0.5, 1.0]
GAINS = np.array([1.0, 2.0])
CACHE = {}
HALF, WHOLE = (lambda x: 0.5 * x), (lambda x: 1.0 * x)
GAINS[1] = 4.0
OFFSET = partial(np.add, 1.0)
TUNED = (Entry("x", "1", 0.5, 2.0, "log"),)


def doubled(function):
    'Twice what it gives.'

    @wraps(function)
    def inner(*args):
        return 2.0 * function(*args)

    return inner


class Holding(Law):
    decay = 0.25

    def __init__(self, mpc, gain):
        super().__init__(mpc)
        self.gain = gain

    @property
    def scale(self):
        return 10.0

    def begin(self):
        pass

    @doubled
    def act(self, y, reference):
        gain = HALF(self.gain) * GAINS[0] * np.mean(GAINS) * max(y[0], 1e-3)
        return gain * beside.halved(self.held) * self.decay / self.scale


class Held(Holding):
    pass


def build(lab):
    return partial(made, Held, lab.study.mpc)


def made(kind, mpc, x):
    return kind(mpc, *x)


class Mine(Method):
    def __init__(self, budget):
        object.__setattr__(self, "budget", budget)

    def offers(self, lab):
        CACHE["lab"] = lab
        yield from tuned(lab, TUNED, lambda x: build(lab)(OFFSET(x * SHARES[0])), most=self.budget)


@dataclass(frozen=True)
class Outer(Method):
    inner: Method = field(default_factory=lambda: Mine(3))

    def offers(self, lab):
        return self.inner.offers(lab)


comparison = Comparison(
    study=study(), tasks={"circle": study().task},
    methods={"mine": Mine(3), "outer": Outer(), "learning": IterativeLearning(Mine(3))}, seeds=(0,), checkpoints=(3,),
)
"""
BESIDE = """
def halved(x):
    return half() * x

def half():
    return 0.5
"""
EDITS = {
    "a number in a class that only a nested function names": ("decay = 0.25", "decay = 0.5"),
    "its property": ("return 10.0", "return 5.0"),
    "its method": ("/ self.scale", "* self.scale"),
    "its constructor": ("self.gain = gain", "self.gain = -gain"),
    "an array": ("[1.0, 2.0]", "[1.0, 3.0]"),
    "what is put into it later": ("GAINS[1] = 4.0", "GAINS[1] = 5.0"),
    "a function of a library": ("np.mean", "np.max"),
    "a function of Python's own": ("max(y[0], 1e-3)", "min(y[0], 1e-3)"),
    "the first of two functions without a name": ("0.5 * x)", "0.6 * x)"),
    "what decorates": ("2.0 * function", "3.0 * function"),
    "a list": ("[0.5, 1.0]", "[0.6, 1.0]"),
    "settings of a library's object": ('0.5, 2.0, "log"', '0.5, 4.0, "log"'),
    "what a partial function was given": ("np.add, 1.0", "np.add, 2.0"),
    "a function that a partial one is made of": ("kind(mpc, *x)", "kind(mpc, -x[0])"),
    "a nested function": ("x * SHARES[0]", "x * SHARES[1]"),
    "what a constructor of one's own was given": ("Mine(3)", "Mine(4)"),
    "a function of a module beside": ("half() * x", "half() + x"),
    "what that one calls": ("return 0.5", "return 0.6"),
}


@pytest.fixture
def digests(tmp_path, monkeypatch):
    """Of all methods, after the scripts were written; each time as a fresh process has them."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def told(script, beside=BESIDE):
        (tmp_path / "beside.py").write_text(beside)
        (tmp_path / "script.py").write_text(script)
        sys.modules.pop("beside", None)
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        made = load_comparison(tmp_path / "script.py")
        return {name: made.digest("circle", name, 0) for name in made.methods}

    return told


@pytest.mark.parametrize(("old", "new"), EDITS.values(), ids=EDITS)
def test_an_edit_makes_another_method_of_all_that_use_it(digests, old, new):
    before, after = digests(SCRIPT), digests(SCRIPT.replace(old, new), BESIDE.replace(old, new))
    assert (SCRIPT + BESIDE).count(old) >= 1
    assert all(after[name] != before[name] for name in before)


def test_what_does_nothing_leaves_it_what_it_is(digests):
    moved = "# A remark.\n\n" + SCRIPT.replace("SHARES = ", "UNUSED = 3\nSHARES = ")
    moved = moved.replace('"mine": ', '"other": Outer(), "mine": ').replace("Twice what it gives", "Two times")
    before, after = digests(SCRIPT), digests(moved, "# Another.\n\n" + BESIDE)
    assert {name: after[name] for name in before} == before


def test_what_a_method_keeps_while_it_runs_does_not_change_it(tmp_path, digests):
    first = digests(SCRIPT)
    made = load_comparison(tmp_path / "script.py")
    list(made.methods["mine"].offers(Lab(made.study, (30.0,))))
    assert made.digest("circle", "mine", 0) == first["mine"]


def test_in_another_process_it_is_the_same(digests, tmp_path):
    code = (
        "from pathlib import Path; from socasadi.baselines import load_comparison as load;"
        "c = load(Path('script.py')); print(*[c.digest('circle', name, 0) for name in c.methods])"
    )
    here = [*digests(SCRIPT).values()]
    paths = {"PYTHONPATH": ":".join(p for p in sys.path if p), "PYTHONHASHSEED": "7"}
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=paths, capture_output=True, text=True)
    assert run.stdout.split() == here, run.stderr


def test_code_of_ones_own_robot_counts_too(digests):
    robot = "from baselines_support import LinearPlant\nclass Robot(LinearPlant):\n    lag = 1\n"
    script = robot + SCRIPT.replace("study=study()", "study=study(Robot())")
    before, after = digests(script), digests(script.replace("lag = 1", "lag = 2"))
    assert all(after[name] != before[name] for name in before)
