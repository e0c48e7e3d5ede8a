"""What an export is compared with, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.codegen import c_compiler, shared_library
from socasadi.export import ControllerRecord, ExportError, build_and_replay, check_single_precision, export
from socasadi.mpc import (
    ControllerInfo,
)

pytestmark = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])
SYSTEM = Modal().state_space(THETA, 0.05)
TIGHT = LinearMPC(Modal(), input_bounds=(-4, 4), output_bounds=(-0.03, 0.03))


class Told:
    """A controller that answers 0, but for one sample."""

    def __init__(self, mpc, at, answer, status):
        self.mpc, self.at, self.answer, self.status = mpc, at, answer, status
        self.resets, self.measured, self.info = [], [], ControllerInfo()

    def reset(self, held):
        self.resets.append(held)

    def step(self, y, *_):
        self.measured.append(y)
        now = len(self.measured) == self.at
        self.info.status = self.status if now else 0
        return np.array([0.0, self.answer if now else 0.0, 0.0])


def recorded(mpc, output):
    preview = np.zeros((len(output), mpc.reference_rows, 2))
    return ControllerRecord(mpc, SYSTEM, output, preview, np.array([1.0, 2.0, 0.5]), provenance=("a test",))


@pytest.fixture
def accepted(monkeypatch):
    """What comes of single precision that is off in one sample, of 5 recorded ones and the random ones behind; the
    controllers that were asked."""

    def check(at, answer, status=0, status_in_double=0):
        asked = []

        def made(mpc, _, *, real="double"):
            assert mpc.backend == "active-set"
            told = (answer, status) if real == "float" else (0.0, status_in_double)
            asked.append(Told(mpc, at, *told))
            return asked[-1]

        monkeypatch.setattr(LinearMPC, "controller_for", made)
        mpc = LinearMPC(Modal(), backend="daqp", input_bounds=(-5, 5), output_bounds=(-0.1, 0.1))
        return check_single_precision(recorded(mpc, np.zeros((5, 2)))), asked

    return check


def test_the_largest_share_of_a_bound_that_single_precision_is_off_by_is_told(accepted):
    """0.0045 of 5 N, wherever it is."""
    for at in (1, 3, 5, 6, 300):
        assert accepted(at, -0.0045)[0] == pytest.approx(0.9e-3, rel=1e-9)


def test_single_precision_is_tried_from_what_was_held_and_as_far_as_the_outputs_may_go(accepted):
    for controller in accepted(1, 0.0)[1]:
        assert np.array_equal(controller.resets[0], [1.0, 2.0, 0.5])
        measured = np.array(controller.measured)
        assert not measured[:5].any()
        assert len(measured) > 100
        assert np.abs(measured).max() > 0.09
        held = np.array(controller.resets[1:])
        assert held.min() < -4 < 4 < held.max()


@pytest.mark.parametrize("answer", [0.0055, -0.0055, np.nan, np.inf])
@pytest.mark.parametrize(("at", "where"), [(3, "sample 2 of the episode"), (5, "sample 4"), (6, r"random \w+ 0")])
def test_single_precision_that_is_off_by_more_than_a_thousandth_is_refused_wherever_it_is(accepted, at, where, answer):
    with pytest.raises(ExportError, match=f"{where}.* an input differs"):
        accepted(at, answer)


def test_single_precision_that_falls_back_where_double_does_not_is_refused_however_near_its_answer(accepted):
    for status in (1, 2):
        with pytest.raises(ExportError, match="sample 1 of the episode its QP is solved only to"):
            accepted(2, 0.0, status=status)
        assert accepted(2, 0.0, status=status, status_in_double=status)[0] == 0
    assert accepted(2, 0.0, status=0, status_in_double=1)[0] == 0


@pytest.mark.parametrize(("real", "kind"), [("float", "float"), ("double", "double")])
def test_an_exported_folder_computes_in_the_numbers_that_it_was_asked_for_by_itself(tmp_path, real, kind):
    """However it is compiled: no flag says so."""
    export(recorded(LinearMPC(Modal()), np.zeros((3, 2))), tmp_path, real=real, figures=False)
    claim = f'#include "real.h"\ntypedef char same[sizeof(real) == sizeof({kind}) ? 1 : -1];\nsame shown;\n'
    shared_library("real-check", {"real.h": (tmp_path / "real.h").read_text(), "check.c": claim})


@pytest.mark.parametrize(
    ("real", "scale", "other"),
    [
        ("float", "{10.0f, 10.0f, 10.0f}", "{10.0f, 10.0f, 9.9f}"),
        ("double", "{10.0, 10.0, 10.0}", "{10.0, 10.0, 9.9999}"),
    ],
)
def test_a_replay_that_is_off_by_a_hundred_thousandth_or_in_float_by_a_hundredth_is_an_error(
    tmp_path, real, scale, other
):
    rng = np.random.default_rng(15)
    export(recorded(LinearMPC(Modal()), 0.03 * rng.normal(size=(20, 2))), tmp_path, real=real, figures=False)
    assert build_and_replay(tmp_path).startswith("passed: 20 samples")
    data = (tmp_path / "controller_data.h").read_text()
    assert data.count(scale) > 0
    (tmp_path / "controller_data.h").write_text(data.replace(scale, other))
    with pytest.raises(ExportError, match="largest difference from Python"):
        build_and_replay(tmp_path)


def test_the_export_answers_to_the_last_bit_as_the_c_does_whatever_solver_the_record_had(tmp_path):
    rng = np.random.default_rng(16)
    export(recorded(replace(TIGHT, backend="qpoases"), 0.03 * rng.normal(size=(40, 2))), tmp_path, figures=False)
    assert "largest difference from Python 0.0e+00 of the bound" in build_and_replay(tmp_path)


@pytest.mark.parametrize("real", ["double", "float"])
def test_bounds_that_are_infinite_are_exported_as_numbers(tmp_path, real):
    bounds = ((-20, -np.inf, -5), (10, 30, np.inf))
    one_sided = LinearMPC(Modal(), rate_bounds=bounds, output_bounds=((-np.inf, -0.1), (0.1, np.inf)))
    rng = np.random.default_rng(17)
    export(recorded(one_sided, 0.03 * rng.normal(size=(20, 2))), tmp_path, real=real, figures=False)
    assert build_and_replay(tmp_path).startswith(
        "passed: 20 samples of the episode and 200 random ones, 0 clipped, 0 held"
    )


def test_a_file_is_not_taken_for_a_folder(tmp_path):
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(ExportError, match="notes is a file; name a folder"):
        export(recorded(TIGHT, np.zeros((3, 2))), tmp_path / "notes", figures=False)
    assert (tmp_path / "notes").read_text() == "mine"
