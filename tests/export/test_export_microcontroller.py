import re
import subprocess
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant
from socasadi.campaign import fly
from socasadi.codegen import c_compiler
from socasadi.export import FLOAT_SHARE, ControllerRecord, export
from socasadi.export.microcontroller import CORTEX_M4, CORTEX_M7, Emulated, EmulatorError, build, toolchain

pytestmark = pytest.mark.skipif(toolchain() is not None, reason=f"no emulated microcontroller: {toolchain()}")
with_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
CORES = [CORTEX_M4, CORTEX_M7]
MPC = LinearMPC(Modal())

HEADER = """
typedef %s real;
#define TOY_OUTPUTS 2
enum { TOY_INPUTS = 3, TOY_PREVIEW = 2, TOY_DISTURBANCES = 0 };
typedef struct {
    int status, iterations;
    real residual;
    unsigned long steps, clipped, held, refused;
    int worst_iterations;
    real worst_residual;
} mpc_info;
typedef struct { mpc_info info; } toy;
void toy_init(toy *);
void toy_reset(toy *, const real *);
int toy_step(toy *, const real *, const real *, real *);
mpc_info toy_info(const toy *);
"""
SOURCE = """
#include "toy.h"
static const real table[2] = {1, 2};
%s
void toy_init(toy *self) { self->info.steps = 0; }
void toy_reset(toy *self, const real *u) { self->info.steps = 0; (void)u; }
mpc_info toy_info(const toy *self) { return self->info; }
int toy_step(toy *self, const real *y, const real *r, real *u) {
    self->info.steps += 1;
    u[0] = y[0];
    u[1] = y[1];
    u[2] = r[3] + table[0];
    %s
    return 0;
}
"""


@pytest.fixture
def toy(tmp_path):
    """Builds a controller of a few lines, whose step runs the given C."""

    def make(core, step="", before=""):
        (tmp_path / "toy.h").write_text(HEADER % core.real)
        (tmp_path / "toy.c").write_text(SOURCE % (before, step))
        return build(tmp_path, core, name="toy")

    return make


@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_numbers_cross_unchanged_to_the_last_bit(toy, core):
    number = np.float32 if core.real == "float" else np.float64
    limits = np.finfo(number)
    random = np.random.default_rng(0).standard_normal(20).astype(number)
    strange = [0.0, -0.0, np.nan, np.inf, -np.inf, limits.max, limits.smallest_subnormal, 1 / number(3), *random]
    with Emulated(toy(core), MPC) as controller:
        for value in strange:
            u = controller.step([value, -value], [0.0, 0.0])
            assert u[:2].astype(number).tobytes() == np.array([value, -value], number).tobytes()


def test_references_are_cut_or_held_to_the_preview(toy):
    with Emulated(toy(CORTEX_M7), MPC) as controller:
        assert controller.step([0, 0], [3.0, 4.0])[2] == 5.0
        assert controller.step([0, 0], [[3.0, 4.0], [5.0, 6.0], [7.0, 8.0]])[2] == 7.0
        with pytest.raises(ValueError, match=r"y has shape \(3,\)"):
            controller.step([0, 0, 0], [0, 0])
        with pytest.raises(ValueError, match=r"reference has shape \(3,\)"):
            controller.step([0, 0], [0, 0, 0])
        with pytest.raises(ValueError, match="disturbance has shape"):
            controller.step([0, 0], [0, 0], [1.0])


@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_instructions_are_counted_one_by_one(toy, core):
    turns = '{ int n = (int)y[0]; __asm__ volatile("0: subs %0, #1\\n\\tbne 0b" : "+l"(n) : : "cc"); }'
    asked = [1, 2, 3, 4, 5, 6, 7, 1000, 12345, 2_500_000]
    with Emulated(toy(core, turns), MPC) as controller:
        for n in asked:
            controller.step([n, 0], [0, 0])
        count = [sample.instructions for sample in controller.samples]
    assert [c - count[0] for c in count] == [2 * (n - 1) for n in asked]


def test_stack_is_told_to_the_word(toy):
    used = []
    for words in (10, 300):
        touch = f"{{ volatile int a[{words}]; a[0] = a[{words - 1}] = 1; }}"
        with Emulated(toy(CORTEX_M4, touch), MPC) as controller:
            controller.step([0, 0], [0, 0])
            used.append(controller.footprint.stack)
    assert used[1] - used[0] == 4 * 290


def test_flash_and_ram_are_what_the_controller_adds(toy):
    plain = toy(CORTEX_M4)
    larger = toy(
        CORTEX_M4,
        step="memory[(int)y[0]] += other[0]++ + constants[(int)y[1]];",
        before="static int memory[250], other[25] = {1}; static const int constants[500] = {1};",
    )
    size = subprocess.check_output(["arm-none-eabi-size", plain.image.parent / "toy.o"], text=True)
    assert plain.flash == pytest.approx(int(size.splitlines()[1].split()[0]), abs=8)
    assert plain.ram == 9 * 4
    assert larger.ram - plain.ram == 1000 + 100
    assert 2000 + 100 < larger.flash - plain.flash < 2000 + 100 + 100
    assert larger.image_flash - plain.image_flash == larger.flash - plain.flash
    assert larger.image_ram - plain.image_ram == larger.ram - plain.ram


FAULTS = {
    "recursion": ("u[0] = deep(1000000);", "its stack overflowed"),
    "null": (
        "*(volatile int *)(y[0] == 0 ? 8 : 1) = 1;",
        r"it accessed 0x0000000\d, where nothing may be .*in toy_step",
    ),
    "constant": ("*(volatile real *)&table[1] = 3;", "it accessed 0x0000.*, where nothing may be written"),
    "nowhere": ("*(volatile int *)0x30000000 = 3;", "it accessed 0x30000000, where there is no memory"),
    "jump": ("((void (*)(void))0x50000001)();", "it jumped to where there is no code"),
    "undefined": ('__asm__ volatile("udf #3");', "it met an instruction that this core does not have"),
    "unaligned": ('__asm__ volatile("ldrd r2, r3, [%0]" : : "r"((char *)u + 1) : "r2", "r3");', "that is not aligned"),
    "endless": ("for (;;) *(volatile real *)u = 1;", "it was not done after 100,000,000 instructions .in toy_step"),
}
DEEP = """
static __attribute__((noinline)) real deep(int n) {
    volatile real a[8];
    a[n % 8] = 1;
    return n ? deep(n - 1) + a[2] : 0;
}
"""


@pytest.fixture
def started(monkeypatch):
    """Processes that a test started."""
    processes, popen = [], subprocess.Popen

    def recorded(*arguments, **options):
        processes.append(popen(*arguments, **options))
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", recorded)
    return processes


@pytest.mark.parametrize("fault", FAULTS)
def test_a_controller_that_breaks_off_is_one_clear_error_and_leaves_no_process(toy, started, fault):
    step, said = FAULTS[fault]
    firmware = toy(CORTEX_M4, step, DEEP if fault == "recursion" else "")
    started.clear()
    with Emulated(firmware, MPC) as controller, pytest.raises(EmulatorError, match=f"'toy' on .* broke off: .*{said}"):
        controller.step([0, 0], [0, 0])
    assert started[0].returncode is not None
    with pytest.raises(EmulatorError, match="no emulator runs"):
        controller.step([0, 0], [0, 0])


def test_so_is_an_emulator_that_ends_or_does_not_answer(toy, started):
    firmware = toy(CORTEX_M4)
    started.clear()
    with Emulated(firmware, MPC) as controller:
        started[0].kill()
        with pytest.raises(EmulatorError, match="broke off: it ended by itself"):
            controller.step([0, 0], [0, 0])
    with pytest.raises(EmulatorError, match=r"it gave no answer within 1e-06 s"), Emulated(firmware, MPC, timeout=1e-6):
        pass
    with pytest.raises(KeyError), Emulated(firmware, MPC):
        raise KeyError
    assert len(started) == 3
    assert all(process.returncode is not None for process in started)


def test_what_cannot_be_built_says_why(toy, tmp_path, monkeypatch):
    with pytest.raises(EmulatorError, match=r"holds no exported controller: there is no other\.h"):
        build(tmp_path, CORTEX_M4, name="other")
    with pytest.raises(EmulatorError, match="undefined reference to `_sbrk"):
        toy(CORTEX_M4, "u[0] = *(real *)malloc(8);", "#include <stdlib.h>")
    other = Emulated(toy(CORTEX_M4), LinearMPC(Modal(), measured_disturbances=1))
    with pytest.raises(EmulatorError, match="the exported controller has 3 inputs, its specification 2"), other:
        pass
    monkeypatch.setenv("PATH", "")
    assert "apt-get install gcc-arm-none-eabi" in str(toolchain())
    with pytest.raises(EmulatorError, match="qemu-system-arm not found"):
        build(tmp_path, CORTEX_M4, name="toy")


THETA = [4.6, 0.08, 0.0057, -0.0028, -0.0028, 4.6, 0.08, 0.0, 0.0049, -0.0049]


def record(mpc, samples=120):
    """Noisy measurements far and wide, so that bounds on inputs and outputs are active in many samples."""
    random = np.random.default_rng(0)
    angle = 0.1 * (np.arange(samples)[:, None] + np.arange(1, mpc.reference_rows + 1))
    preview = 0.12 * np.stack([np.cos(angle), np.sin(2 * angle)], axis=-1)
    output = 0.07 * np.cumsum(random.standard_normal((samples, 2)), axis=0) / np.sqrt(samples)
    system = mpc.model.state_space(THETA, mpc.sample_time)
    disturbance = np.linspace(-5, 5, samples * mpc.measured_disturbances).reshape(samples, -1)
    held = np.array([1.0, -2.0, 0.5])[: mpc.inputs]
    return ControllerRecord(mpc, system, output, preview, held, disturbance)


def replay(controller, recorded):
    controller.reset(recorded.held)
    samples = zip(recorded.output, recorded.preview, recorded.disturbance, strict=True)
    return np.array([controller.step(y, rows, w) for y, rows, w in samples])


@pytest.fixture(scope="module")
def emulated(tmp_path_factory):
    """Answers and costs of the recorded samples on either core, each of them run twice."""

    def run(core):
        folder = export(record(MPC), tmp_path_factory.mktemp("export"), real=core.real)
        with Emulated(build(folder, core), MPC) as controller:
            first = replay(controller, record(MPC))
            again = replay(controller, record(MPC))
            assert again.tobytes() == first.tobytes()
            return folder, first, controller

    return {core.name: run(core) for core in CORES}


@with_compiler
@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_the_microcontroller_answers_as_the_host_does_to_the_last_bit(emulated, core):
    _, u, controller = emulated[core.name]
    recorded = record(MPC)
    on_host = MPC.controller_for(recorded.system, real=core.real)
    assert u.tobytes() == replay(on_host, recorded).tobytes()
    assert controller.info == on_host.info
    assert {sample.iterations for sample in controller.samples} > {0, 1, 2, 3}


@with_compiler
def test_single_precision_is_close_to_double(emulated):
    single, double = (emulated[core.name][1] for core in CORES)
    assert 0 < np.abs(single - double).max() / 10 < FLOAT_SHARE


@with_compiler
@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_another_run_takes_the_same_instructions_and_stack(emulated, core):
    _, _, before = emulated[core.name]
    with Emulated(before.firmware, MPC) as controller:
        replay(controller, record(MPC))
        replay(controller, record(MPC))
        assert controller.samples == before.samples
        assert controller.footprint == before.footprint


@with_compiler
@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_stack_is_that_of_the_deepest_chain_of_calls(emulated, tmp_path, core):
    folder, _, controller = emulated[core.name]
    command = ["arm-none-eabi-gcc", "-std=c99", "-O2", *core.flags, f"-I{folder}", "-fcallgraph-info=su", "-c"]
    for source in ("mpc.c", "qp.c", "qp_residual.c", "controller.c"):
        subprocess.run([*command, str(folder / source)], cwd=tmp_path, check=True)
    text = "".join(file.read_text() for file in tmp_path.glob("*.ci"))
    frames = {n: int(s) for n, s in re.findall(r'node: { title: "(\S+)" label: "\S+\\n(\d+) bytes \(static\)"', text)}
    calls = re.findall(r'edge: { sourcename: "(\S+)" targetname: "(\S+)"', text)
    assert len(frames) > 10

    def depth(function):
        below = [depth(called) for calling, called in calls if calling == function]
        return frames.get(function, 0) + max(below, default=0)

    deepest = depth("controller_step")
    assert 0.8 * deepest <= controller.footprint.stack <= deepest


@with_compiler
def test_a_whole_episode_with_the_rod_in_the_loop_is_the_one_of_the_host():
    plant, task = SimulatedPlant(Rod.preset("paper")), Circle()
    system = MPC.model.state_space(THETA, MPC.sample_time)
    held = np.zeros(3)
    samples = ControllerRecord(MPC, system, np.zeros((1, 2)), np.zeros((1, MPC.reference_rows, 2)), held)
    with TemporaryDirectory() as folder, Emulated(build(export(samples, folder), CORTEX_M7), MPC) as controller:
        there = fly(plant, controller, task, seed=3, time_limit=100.0)
    here = fly(plant, MPC.controller_for(system), task, seed=3, time_limit=100.0)
    assert there.failure is None
    assert there.fallbacks == 0
    assert there.tension.shape == (400, 3)
    assert there.tension.tobytes() == here.tension.tobytes()
    assert np.abs(there.truth[100:] - there.reference[100:]).max() < 5e-3


@with_compiler
def test_measured_disturbances_reach_the_controller(tmp_path):
    mpc = LinearMPC(Modal(), measured_disturbances=1)
    recorded = record(mpc, samples=20)
    with Emulated(build(export(recorded, tmp_path), CORTEX_M7), mpc) as controller:
        u = replay(controller, recorded)
    assert u.tobytes() == replay(mpc.controller_for(recorded.system), recorded).tobytes()
