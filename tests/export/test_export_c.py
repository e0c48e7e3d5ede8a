import subprocess
from dataclasses import replace

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.codegen import c_compiler
from socasadi.export import ControllerRecord, ExportError, build_and_replay, export

THETA = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]
with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")


def record(mpc: LinearMPC, samples: int = 120) -> ControllerRecord:
    """Noisy measurements far and wide, so that bounds on inputs and outputs are active in many samples."""
    random = np.random.default_rng(0)
    angle = 0.1 * (np.arange(samples)[:, None] + np.arange(1, mpc.horizon + 1))
    preview = 0.12 * np.stack([np.cos(angle), np.sin(2 * angle)], axis=-1)
    output = 0.07 * np.cumsum(random.standard_normal((samples, 2)), axis=0) / np.sqrt(samples)
    system = mpc.model.state_space(THETA, mpc.sample_time)
    return ControllerRecord(mpc, system, output, preview, held=np.array([1.0, -2.0, 0.5]), provenance=("a test",))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return export(record(LinearMPC(Modal())), tmp_path_factory.mktemp("export") / "controller")


@with_compiler
def test_the_built_controller_agrees_with_python_along_an_episode(folder):
    said = build_and_replay(folder)
    assert said.startswith("120 samples, 0 clipped, 0 held")


@with_compiler
@pytest.mark.parametrize(
    "change",
    [
        {"input_bounds": (0.0, 10.0)},
        {"input_bounds": ((-3.0, -10.0, -1.0), (7.0, 2.0, 10.0))},
        {"output_bounds": None},
        {"input_term": "literal", "R": 1e-3},
        {"terminal": None, "horizon": 6},
        {"backend": "qpoases"},
    ],
)
def test_so_do_controllers_with_other_settings(tmp_path, change):
    export(record(replace(LinearMPC(Modal()), **change), samples=40), tmp_path / "c")
    assert build_and_replay(tmp_path / "c").startswith("40 samples, 0 clipped, 0 held")


@with_compiler
def test_a_replay_that_differs_is_an_error(folder, tmp_path):
    import shutil

    wrong = shutil.copytree(folder, tmp_path / "wrong")
    data = (wrong / "controller_data.h").read_text()
    (wrong / "controller_data.h").write_text(data.replace("{10.0, 10.0, 10.0}", "{10.0, 10.0, 9.0}"))
    with pytest.raises(ExportError, match="largest difference from Python"):
        build_and_replay(wrong)


HOSTILE = r"""
#include <math.h>
#include <stdio.h>
#include "controller.h"
static unsigned state = 1;
static int draw(int below) {
    state = state * 1664525u + 1013904223u;
    return (int)((state >> 16) % (unsigned)below);
}
int main(void) {
    const double strange[] = {NAN, INFINITY, -INFINITY, 1e300, -1e12, 0.0, 0.05};
    const int kinds = sizeof strange / sizeof *strange;
    double y[CONTROLLER_OUTPUTS], r[CONTROLLER_HORIZON * CONTROLLER_OUTPUTS], u[CONTROLLER_INPUTS];
    const double none[CONTROLLER_INPUTS] = {0};
    controller self;
    long t, outside = 0;
    int status = -1;
    controller_init(&self);
    for (t = 0; t < 2000; ++t) {
        int i;
        if (t % 50 == 0) controller_reset(&self, none);
        for (i = 0; i < CONTROLLER_OUTPUTS; ++i) y[i] = strange[draw(kinds)];
        for (i = 0; i < CONTROLLER_HORIZON * CONTROLLER_OUTPUTS; ++i) r[i] = t % 3 ? 0.05 : strange[draw(kinds)];
        controller_step(&self, y, r, u);
        for (i = 0; i < CONTROLLER_INPUTS; ++i) outside += !(u[i] >= -10.0 && u[i] <= 10.0);
    }
    printf("%ld %d ", outside, self.held > 0);
    /* Afterwards it works as before: the strange samples have blinded nothing. */
    for (t = 0; t < 100; ++t) {
        int i;
        for (i = 0; i < CONTROLLER_OUTPUTS; ++i) y[i] = 0.0;
        for (i = 0; i < CONTROLLER_HORIZON * CONTROLLER_OUTPUTS; ++i) r[i] = 0.0;
        status = controller_step(&self, y, r, u);
    }
    printf("%d\n", status);
    return 0;
}
"""


@with_compiler
def test_whatever_comes_in_the_tensions_stay_inside_their_bounds_and_nothing_is_spoilt(folder):
    (folder / "hostile.c").write_text(HOSTILE)
    build_and_replay(folder)
    compiler = [*(c_compiler() or []), "-std=c99", "-O1", "-I.", "-Iosqp/include", "hostile.c", "libcontroller.a"]
    subprocess.run([*compiler, "osqp/libosqpstatic.a", "-lm", "-o", "hostile"], cwd=folder, check=True)
    said = subprocess.run(["./hostile"], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert said.split() == ["0", "1", "0"]


def test_the_header_says_where_the_controller_comes_from(folder):
    header = (folder / "controller_data.h").read_text()
    assert " * a test\n" in header
    assert "made with socasadi" in header
    assert "#define CONTROLLER_HORIZON 10" in header


def test_what_cannot_be_exported_yet_is_said(tmp_path):
    whole = record(LinearMPC(Modal()), samples=2)
    with pytest.raises(ExportError, match="real='float' cannot be exported yet"):
        export(whole, tmp_path / "c", real="float")
    with pytest.raises(ExportError, match="solver='active-set' cannot be exported yet"):
        export(whole, tmp_path / "c", solver="active-set")
    assert not (tmp_path / "c").exists()


def test_no_file_of_somebody_elses_is_written_over(tmp_path):
    (tmp_path / "thesis.tex").write_text("all of it")
    (tmp_path / "Makefile").write_text("mine")
    with pytest.raises(ExportError, match=r"files of the same names that are not an export's \(Makefile\)"):
        export(record(LinearMPC(Modal()), samples=2), tmp_path)
    (tmp_path / "Makefile").unlink()
    export(record(LinearMPC(Modal()), samples=2), tmp_path)
    export(record(LinearMPC(Modal()), samples=3), tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "all of it"


def test_without_a_compiler_the_folder_is_written_and_the_reason_said(folder, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ExportError, match="was not built: no C compiler found; run 'make test'"):
        build_and_replay(folder)


def test_every_file_of_c_is_in_the_package():
    from importlib.resources import files

    names = {file.name for file in files("socasadi.export").joinpath("c").iterdir()}
    assert names >= {"controller.c", "controller.h", "replay.c", "Makefile"}
