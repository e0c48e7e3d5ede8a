import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.codegen import c_compiler
from socasadi.export import FLOAT_SHARE, ControllerRecord, ExportError, build_and_replay, check_single_precision, export
from socasadi.mpc import controller_sources

THETA = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]
FOUR = [*THETA[:5], 0.01, *THETA[5:], -0.02]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"]
with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")

BUSY = LinearMPC(Modal(), rate_bounds=(-40, 60), slack_linear=300.0, delay=1)
TOLD = LinearMPC(Modal(inputs=4), measured_disturbances=1, input_bounds=(0, 10), preview=3)


def record(mpc: LinearMPC, samples: int = 120) -> ControllerRecord:
    """Noisy measurements far and wide, so that bounds on inputs and outputs are active in many samples."""
    random = np.random.default_rng(0)
    angle = 0.1 * (np.arange(samples)[:, None] + np.arange(1, mpc.reference_rows + 1))
    preview = 0.12 * np.stack([np.cos(angle), np.sin(2 * angle)], axis=-1)
    output = 0.07 * np.cumsum(random.standard_normal((samples, 2)), axis=0) / np.sqrt(samples)
    return ControllerRecord(
        mpc=mpc,
        system=mpc.model.state_space(THETA if mpc.model.inputs == 3 else FOUR, mpc.sample_time),
        output=output,
        preview=preview,
        held=np.array([1.0, 2.0, 0.5]),
        disturbance=random.standard_normal((samples, mpc.measured_disturbances)),
        provenance=("a test",),
    )


def run(*command, folder) -> str:
    done = subprocess.run(list(map(str, command)), cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def compile_fuzz(folder: Path, *flags: str) -> None:
    sources = [Path(__file__).with_name("fuzz.c"), "controller.c", "mpc.c", "qp.c", "qp_residual.c"]
    run(*c_compiler(), "-std=c99", "-I.", *flags, *sources, "-lm", "-o", "fuzz", folder=folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return export(record(LinearMPC(Modal())), tmp_path_factory.mktemp("export") / "controller")


@with_compiler
def test_the_built_controller_answers_as_python_does_to_the_last_bit(folder):
    said = build_and_replay(folder)
    assert said.startswith("passed: 120 samples of the episode and 200 random ones, 0 clipped, 0 held")
    assert "largest difference from Python 0.0e+00 of the bound" in said


KINDS = {
    "pulling": LinearMPC(Modal(), input_bounds=(0.0, 10.0)),
    "blocked": LinearMPC(Modal(), input_bounds=((-3.0, -10.0, -1.0), (7.0, 2.0, 10.0)), control_horizon=(1, 2, 7)),
    "unbounded outputs": LinearMPC(Modal(), output_bounds=None, disturbance_model="input"),
    "one row": LinearMPC(Modal(), input_term="literal", R=1e-2, preview=1),
    "short": LinearMPC(Modal(), terminal=None, horizon=6, backend="qpoases"),
    "rates": BUSY,
    "told": TOLD,
}


@pytest.fixture
def unoptimised(monkeypatch):
    """The same arithmetic, compiled in half the time."""
    monkeypatch.setenv("CFLAGS", "-O0")


@with_compiler
@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("kind", KINDS)
def test_so_do_all_kinds_of_controllers_within_what_their_numbers_allow(tmp_path, kind, real):
    export(record(KINDS[kind], samples=40), tmp_path / "c", real=real, figures=False)
    assert build_and_replay(tmp_path / "c").startswith(
        "passed: 40 samples of the episode and 200 random ones, 0 clipped, 0 held"
    )


@with_compiler
@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize(("kind", "real"), [*((kind, "double") for kind in KINDS), ("pulling", "float")])
def test_so_do_those_that_solve_by_osqp(tmp_path, kind, real):
    pytest.importorskip("osqp", reason="the package osqp is not installed")
    export(record(KINDS[kind], samples=40), tmp_path / "c", real=real, solver="osqp", figures=False)
    assert build_and_replay(tmp_path / "c").startswith(
        "passed: 40 samples of the episode and 200 random ones, 0 clipped, 0 held"
    )


@with_compiler
@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("mpc", [LinearMPC(Modal()), BUSY, TOLD, KINDS["unbounded outputs"]])
def test_a_controller_of_a_given_model_is_exported_with_an_episode_on_that_model(tmp_path, mpc):
    system = mpc.model.state_space(THETA if mpc.model.inputs == 3 else FOUR, mpc.sample_time)
    simulated = ControllerRecord.simulated(mpc, system, samples=60)
    export(simulated, tmp_path, figures=False)
    assert build_and_replay(tmp_path).startswith(
        "passed: 60 samples of the episode and 200 random ones, 0 clipped, 0 held"
    )
    # It tracks: after each jump of the reference the outputs come nearer to it than they were.
    away = np.linalg.norm(simulated.output - simulated.preview[:, -1], axis=1)
    assert away[21] > 3 * away[38]


@with_compiler
def test_a_replay_that_differs_is_an_error(folder, tmp_path):
    wrong = shutil.copytree(folder, tmp_path / "wrong")
    data = (wrong / "controller_data.h").read_text()
    (wrong / "controller_data.h").write_text(data.replace("{10.0, 10.0, 10.0}", "{10.0, 10.0, 9.0}"))
    with pytest.raises(ExportError, match="largest difference from Python"):
        build_and_replay(wrong)


@with_compiler
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("mpc", [LinearMPC(Modal()), TOLD], ids=["default", "told"])
def test_every_file_compiles_without_a_warning(tmp_path, mpc, real):
    export(record(mpc, samples=5), tmp_path, real=real, figures=False)
    for source in sorted(tmp_path.glob("*.c")):
        run(*c_compiler(), *STRICT, "-O2", "-c", source.name, "-o", "object.o", folder=tmp_path)


@with_compiler
def test_two_controllers_of_other_names_and_sizes_share_a_program(tmp_path):
    export(record(LinearMPC(Modal()), samples=5), tmp_path / "one", name="arm", figures=False)
    export(record(TOLD, samples=5), tmp_path / "two", name="wrist", figures=False)
    for file in ("wrist.h", "wrist.c", "wrist_data.h"):
        shutil.copy(tmp_path / "two" / file, tmp_path / "one")
    (tmp_path / "one" / "both.c").write_text(
        '#include "arm.h"\n#include "wrist.h"\nstatic arm a; static wrist b;\n'
        "int main(void) { real y[2] = {0}, r[20] = {0}, w[1] = {0}, u[3]; arm_init(&a); wrist_init(&b);\n"
        "return arm_step(&a, y, r, u) + wrist_step(&b, y, r, w, u); }\n"
    )
    run(
        *c_compiler(),
        *STRICT,
        "both.c",
        "arm.c",
        "wrist.c",
        "mpc.c",
        "qp.c",
        "qp_residual.c",
        "-o",
        "both",
        folder=tmp_path / "one",
    )
    run("./both", folder=tmp_path / "one")


@with_compiler
def test_two_exports_of_different_number_types_link_into_one_program(tmp_path):
    for name, real in (("arm", "double"), ("wrist", "float")):
        export(record(LinearMPC(Modal()), samples=5), tmp_path / name, name=name, real=real, figures=False)
        (tmp_path / name / "use.c").write_text(
            f'#include "{name}.h"\nint use_{name}(void);\nint use_{name}(void) {{ static {name} c;'
            f"real y[2] = {{0}}, r[20] = {{1}}, u[3]; {name}_init(&c); return {name}_step(&c, y, r, u); }}\n"
        )
        units = [f"{part}.c" for part in ("use", name, "mpc", "qp", "qp_residual")]
        run(*c_compiler(), *STRICT, "-c", *units, folder=tmp_path / name)
    (tmp_path / "main.c").write_text(
        "int use_arm(void); int use_wrist(void);\nint main(void) { return use_arm() + use_wrist(); }\n"
    )
    objects = sorted(path.relative_to(tmp_path) for path in tmp_path.glob("*/*.o"))
    run(*c_compiler(), "main.c", *objects, "-o", "both", folder=tmp_path)
    run("./both", folder=tmp_path)


@with_compiler
def test_two_exports_that_solve_by_osqp_do_not_link_into_one_program(tmp_path):
    pytest.importorskip("osqp", reason="the package osqp is not installed")
    for name in ("arm", "wrist"):
        export(record(LinearMPC(Modal()), samples=2), tmp_path / name, name=name, solver="osqp", figures=False)
        run("make", "-s", folder=tmp_path / name)
    (tmp_path / "main.c").write_text(
        "void arm_init(void *); void wrist_init(void *); int arm_step(); int wrist_step();\n"
        "int main(void) { arm_init(0); wrist_init(0); return arm_step() + wrist_step(); }\n"
    )
    command = [*(c_compiler() or []), "main.c", "arm/libarm.a", "wrist/libwrist.a", "-lm", "-o", "both"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert "only_one_osqp_in_a_program" in done.stderr


@with_compiler
def test_data_of_another_size_do_not_compile(folder, tmp_path):
    here = shutil.copytree(folder, tmp_path / "here")
    export(record(LinearMPC(Modal(), horizon=12), samples=2), tmp_path / "longer", figures=False)
    shutil.copy(tmp_path / "longer" / "controller_data.h", here)
    command = [*(c_compiler() or []), "-std=c99", "-c", "controller.c", "-o", "object.o"]
    assert subprocess.run(command, cwd=here, capture_output=True).returncode != 0


def test_a_controller_whose_qp_is_seldom_solved_is_exported_with_a_warning(tmp_path):
    hopeless = LinearMPC(Modal(), Q=1e6, R=1e-9)
    with pytest.warns(RuntimeWarning, match="samples the controller falls back from its QP's answer"):
        export(record(hopeless), tmp_path, figures=False)


@with_compiler
def test_another_compiler_line_compiles_everything_again(folder, tmp_path):
    here = shutil.copytree(folder, tmp_path / "here")
    run("make", "-s", "test", folder=here)
    before = (here / "mpc.o").stat().st_mtime_ns
    run("make", "-s", "test", folder=here)
    assert (here / "mpc.o").stat().st_mtime_ns == before
    run("make", "-s", "test", "CFLAGS=-O1", folder=here)
    assert (here / "mpc.o").stat().st_mtime_ns > before


@with_compiler
def test_the_example_and_both_build_systems_work(folder, tmp_path):
    here = shutil.copytree(folder, tmp_path / "here")
    assert run("make", "-s", "example", folder=here).count("status 0") == 10
    if shutil.which("cmake"):
        run("cmake", "-B", "build", folder=here)
        run("cmake", "--build", "build", folder=here)
        run("ctest", "--test-dir", "build", folder=here)


@with_compiler
def test_nothing_is_allocated_printed_or_kept_outside_the_instance(folder):
    for source in ("controller.c", "mpc.c", "qp.c", "qp_residual.c"):
        run(*c_compiler(), "-std=c99", "-O2", "-fno-pic", "-c", source, "-o", "object.o", folder=folder)
        symbols = [line.split()[-2:] for line in run("nm", "object.o", folder=folder).splitlines()]
        asked = {name for kind, name in symbols if kind == "U" and not name.startswith(("controller_", "_GLOBAL"))}
        assert asked <= {"memcpy", "memset", "memmove"}
        assert not [name for kind, name in symbols if kind in "bBdDC"]


@with_compiler
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize(
    ("mpc", "calls", "defined"),
    [
        (LinearMPC(Modal()), 100_000, []),
        (BUSY, 50_000, ["-DRATED"]),
        (TOLD, 50_000, ["-DDISTURBED"]),
        pytest.param(LinearMPC(Modal()), 1_000_000, [], marks=pytest.mark.slow),
        pytest.param(BUSY, 500_000, ["-DRATED"], marks=pytest.mark.slow),
    ],
    ids=["default", "rates", "told", "a million", "half a million rated"],
)
def test_whatever_comes_in_the_inputs_keep_their_bounds_and_nothing_is_spoilt(tmp_path, mpc, calls, defined, real):
    export(record(mpc, samples=5), tmp_path, real=real, figures=False)
    compile_fuzz(tmp_path, "-O2", *defined)
    wild, outside, hasty, unknown, refused, clipped, held, status = map(
        int, run("./fuzz", calls, folder=tmp_path).split()
    )
    assert (wild, outside, hasty, unknown) == (0, 0, 0, 0)
    assert min(refused, clipped, held) > calls // 100
    # Afterwards it works as before.
    assert status == 0


@with_compiler
@pytest.mark.parametrize(
    ("defined", "real"),
    [
        ([], "float"),
        (["-DRATED"], "double"),
        (["-DDISTURBED"], "float"),
        pytest.param([], "double", marks=pytest.mark.slow),
        pytest.param(["-DRATED"], "float", marks=pytest.mark.slow),
        pytest.param(["-DDISTURBED"], "double", marks=pytest.mark.slow),
    ],
)
def test_sanitizers_find_nothing_in_it(tmp_path, defined, real):
    mpc = {"-DRATED": BUSY, "-DDISTURBED": TOLD}.get(*defined, "") if defined else LinearMPC(Modal())
    export(record(mpc, samples=5), tmp_path, real=real, figures=False)
    compile_fuzz(tmp_path, "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", *defined)
    run("./fuzz", 20_000, folder=tmp_path)


@with_compiler
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="no valgrind")
def test_valgrind_finds_nothing_in_it(tmp_path):
    export(record(BUSY, samples=5), tmp_path, figures=False)
    compile_fuzz(tmp_path, "-g", "-O1", "-DRATED")
    run("valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "./fuzz", 3_000, folder=tmp_path)


@with_compiler
def test_single_precision_that_differs_too_much_is_refused_with_the_reason(tmp_path):
    """An input that costs nothing beside outputs that must not leave narrow bounds: seven digits do not hold it."""
    stiff = LinearMPC(Modal(), R=1e-4, output_bounds=(-0.02, 0.02), slack_weight=1e7)
    with pytest.raises(ExportError, match=r"single precision does not do .* export it with real='double'"):
        export(record(stiff), tmp_path / "c", real="float")
    assert not (tmp_path / "c").exists()
    assert check_single_precision(record(LinearMPC(Modal()))) < FLOAT_SHARE / 2


@with_compiler
def test_flags_that_would_remove_the_checks_do_not_compile(folder):
    command = [*(c_compiler() or []), "-std=c99", "-O2", "-ffast-math", "-c", "mpc.c", "-o", "object.o"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode != 0
    assert "compile without -ffast-math" in done.stderr


def test_the_header_says_where_the_controller_comes_from(folder):
    header = (folder / "controller_data.h").read_text()
    assert " * a test\n" in header
    assert " * made by socasadi " in header
    assert "#define CONTROLLER_PREVIEW 10 " in (folder / "controller.h").read_text()


def test_another_theta_changes_the_data_header_alone(folder, tmp_path):
    other = record(LinearMPC(Modal()))
    theta = [1.1 * value for value in THETA]
    export(replace(other, system=other.mpc.model.state_space(theta, 0.05)), tmp_path, figures=False)
    differing = {file.name for file in tmp_path.iterdir() if file.read_bytes() != (folder / file.name).read_bytes()}
    assert differing - {"README.md"} == {"controller_data.h", "vectors.h"}


@with_compiler
def test_the_readme_says_what_it_costs(folder):
    table = (folder / "README.md").read_text().split("## What it costs")[1]
    assert "| this machine" in table
    assert "us on average" in table
    assert "?" not in table


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"real": "half"}, "unknown real 'half'; there are double, float"),
        ({"solver": "qrqp"}, "unknown solver 'qrqp'; there are active-set, osqp"),
        ({"name": "My arm"}, "the name 'My arm' does not do for C"),
        ({"name": "mpc"}, "the name 'mpc' does not do for C"),
        ({"name": "float"}, "the name 'float' does not do for C"),
        ({"name": "vectors"}, "the name 'vectors' does not do for C"),
    ],
)
def test_what_cannot_be_exported_is_said(tmp_path, asked, said):
    with pytest.raises(ExportError, match=said):
        export(record(LinearMPC(Modal()), samples=2), tmp_path / "c", **asked)
    assert not (tmp_path / "c").exists()


def test_no_file_of_somebody_elses_is_written_over(tmp_path):
    (tmp_path / "thesis.tex").write_text("all of it")
    (tmp_path / "Makefile").write_text("mine")
    with pytest.raises(ExportError, match=r"files of the same names that are not an export's \(Makefile\)"):
        export(record(LinearMPC(Modal()), samples=2), tmp_path)
    (tmp_path / "Makefile").unlink()
    export(record(LinearMPC(Modal()), samples=2), tmp_path, figures=False)
    export(record(LinearMPC(Modal()), samples=3), tmp_path, figures=False)
    assert (tmp_path / "thesis.tex").read_text() == "all of it"


def test_another_export_into_the_same_folder_leaves_nothing_of_the_first(tmp_path):
    whole = record(LinearMPC(Modal()), samples=2)
    export(whole, tmp_path / "a", name="arm", figures=False)
    (tmp_path / "a" / "main.c").write_text("int main(void) { return 0; }")
    export(whole, tmp_path / "a", name="wrist", figures=False)
    export(whole, tmp_path / "b", name="wrist", figures=False)
    there, fresh = ({file.name for file in (tmp_path / name).iterdir()} for name in "ab")
    assert there == fresh | {"main.c"}


def test_without_a_compiler_the_folder_is_written_and_the_reason_said(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ExportError, match="was not built: no C compiler found; run 'make test'"):
        build_and_replay(folder)
    export(record(LinearMPC(Modal()), samples=5), tmp_path / "c")
    assert "Not measured where this was written" in (tmp_path / "c" / "README.md").read_text()
    with pytest.raises(ExportError, match="real='float' is accepted by test only, and there is no C compiler"):
        export(record(LinearMPC(Modal()), samples=5), tmp_path / "f", real="float")


def test_the_controllers_c_is_in_the_package():
    assert set(controller_sources()) == {"real.h", "qp.h", "qp.c", "qp_residual.c", "mpc.h", "mpc.c"}
