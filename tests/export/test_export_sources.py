"""The C that flies experiments, and the one header that a trial changes."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal
from socasadi.codegen import c_compiler
from socasadi.export import ControllerRecord, ExportError, data_header, export, export_sources

THETA = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"]
with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")

MPC = LinearMPC(Modal(), preview=4)
TOLD = LinearMPC(Modal(inputs=4), measured_disturbances=1)
ROBOT = """
#include "experiment.h"
static int t = 0;
int robot_start(real y[CONTROLLER_OUTPUTS], real u[CONTROLLER_INPUTS]%s) {
    y[0] = (real)0.01; y[1] = 0; u[0] = 3; u[1] = u[2] = 0; %s
    return 0;
}
int robot_hold(const real u[CONTROLLER_INPUTS], real y[CONTROLLER_OUTPUTS]%s) {
    ++t;
    y[0] = u[0] / 1000; y[1] = u[1] / 1000; %s
    return t == %d;
}
"""


def system(mpc):
    theta = THETA if mpc.model.inputs == 3 else [*THETA[:5], 0.01, *THETA[5:], -0.02]
    return mpc.model.state_space(theta, mpc.sample_time)


def reference(mpc, samples=8):
    return Circle().reference(mpc.sample_time * np.arange(samples + 1 + mpc.reference_rows))


@pytest.mark.parametrize("real", ["double", "float"])
def test_the_header_is_the_one_of_a_whole_export(tmp_path, real):
    record = ControllerRecord.simulated(MPC, system(MPC))
    export(record, tmp_path / "c", real=real, name="arm", figures=False)
    alone = data_header(MPC, system(MPC), real=real, name="arm", provenance=record.provenance)
    assert alone == (tmp_path / "c" / "arm_data.h").read_text()


def test_no_file_of_the_sources_depends_on_the_model(tmp_path):
    for i, factor in enumerate((1.0, 0.7)):
        model = MPC.model.state_space(np.array(THETA) * factor, MPC.sample_time)
        export_sources(MPC, model, reference(MPC), tmp_path / str(i))
    files = {file.name for file in (tmp_path / "0").iterdir()}
    assert "controller_data.h" not in files
    for name in files:
        assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "1" / name).read_bytes()


def compiled(folder, mpc, *, real="double", fails_at=-1):
    export_sources(mpc, system(mpc), reference(mpc), folder / "c", real=real)
    (folder / "trial").mkdir()
    (folder / "trial" / "controller_data.h").write_text(data_header(mpc, system(mpc), real=real))
    w = (", real w[CONTROLLER_DISTURBANCES]", "w[0] = (real)t;") if mpc.measured_disturbances else ("", "")
    (folder / "robot.c").write_text(ROBOT % (*w, *w, fails_at))
    sources = sorted((folder / "c").glob("*.c"))
    command = [*c_compiler(), *STRICT, "-ffp-contract=off", "-Ic", "-Itrial", "robot.c", *sources, "-lm", "-o", "fly"]
    built = subprocess.run(list(map(str, command)), cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return subprocess.run(["./fly"], cwd=folder, capture_output=True, text=True)


@with_compiler
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("mpc", [MPC, TOLD], ids=["plain", "told"])
def test_the_experiment_is_the_very_loop_of_python(tmp_path, mpc, real):
    lines = compiled(tmp_path, mpc, real=real).stdout.splitlines()
    k = mpc.measured_disturbances
    assert lines[0] == "t,y1,y2,u1,u2,u3,r1,r2" + ",w1" * k
    before, at_rest = lines[1].split(",", 1)
    assert float(before) == pytest.approx(-0.05)
    assert at_rest == ",,3,0,0,," + "," * k
    assert len(lines) == 2 + 8 + 1
    controller, wanted = mpc.controller_for(system(mpc), real=real), reference(mpc)
    controller.reset([3.0, 0.0, 0.0])
    y, number = np.array([0.01, 0.0]), np.float32 if real == "float" else float
    for t, line in enumerate(lines[2:-1]):
        cells = [float(cell) for cell in line.split(",")]
        w = [float(t)] if k else None
        u = controller.step(cells[1:3], wanted[t + 1 : t + 1 + mpc.reference_rows], w)
        np.testing.assert_array_equal(cells[1:3], y.astype(number))
        np.testing.assert_array_equal(cells[3:6], u)
        np.testing.assert_array_equal(cells[6:8], wanted[t].astype(number))
        assert cells[8:] == (w or [])
        y = (u[:2].astype(number) / number(1000)).astype(float)
    assert lines[-1].split(",")[3:6] == ["", "", ""]


@with_compiler
def test_an_experiment_that_fails_says_so_and_keeps_its_record(tmp_path):
    flown = compiled(tmp_path, MPC, fails_at=3)
    assert flown.returncode == 1
    assert "socasadi tell RUN --trial N --failed REASON" in flown.stderr
    assert len(flown.stdout.splitlines()) == 2 + 3


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda folder: data_header(MPC, system(MPC), name="9"), ExportError, "the name '9' does not do for C"),
        (lambda folder: data_header(MPC, system(MPC), real="half"), ExportError, "unknown real 'half'"),
        (
            lambda folder: export_sources(MPC, system(MPC), reference(MPC, samples=0), folder / "c"),
            ValueError,
            r"reference has shape \(5, 2\), but \(6 or more, 2\) is needed",
        ),
    ],
)
def test_nonsense_is_refused_in_a_sentence(tmp_path, call, error, words):
    with pytest.raises(error, match=words):
        call(tmp_path)


def test_files_of_others_are_not_overwritten(tmp_path):
    (tmp_path / "experiment.c").write_text("mine")
    with pytest.raises(ExportError, match=r"files of the same names that are not an export's \(experiment\.c\)"):
        export_sources(replace(MPC, horizon=5), system(MPC), reference(MPC), tmp_path)
