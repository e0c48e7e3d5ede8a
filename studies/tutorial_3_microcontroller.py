"""Tutorial 3: from a run folder to a microcontroller.

At the end you have a tuned controller as a folder of C, tested, in double and in float; know what it costs in flash,
memory and instructions; and have the loop around it, compiled and run. It takes 10 to 15 s.

    python studies/tutorial_3_microcontroller.py [FOLDER [RUN]]

in a checkout; read along here. All that it writes is in FOLDER, runs/tutorial-3 if you name none. RUN is the run folder
to start from, such as runs/tutorial-1/circle or one of your own with two outputs and three inputs; without it a short
search of tutorial 1's study comes first. Given again it writes the same once more.

It takes a C compiler and make; the emulated microcontroller, which is one section of it, takes
apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm.
"""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

from shell import shell
from tutorial_1_simulated_arm import study

from socasadi.campaign import probe
from socasadi.codegen import c_compiler
from socasadi.export import toolchain
from socasadi.model import identify

# The firmware of section 5: the loop, and what it needs of the board.

FIRMWARE = r"""
#include <math.h>

#include "board.h"
#include "controller.h"

enum { DEAF = 10 }; /* samples without a measurement after which nothing is known of the robot */

static controller self; /* all of its memory */

/* What is wanted: row k is for k + 1 samples from now. Here a circle of 5 cm radius, a turn in 10 s. */
static void wanted(long t, real r[CONTROLLER_PREVIEW * CONTROLLER_OUTPUTS]) {
    int k;
    for (k = 0; k < CONTROLLER_PREVIEW; ++k) {
        const double angle = 6.283185307179586 * (double)(t + k + 1) * (double)CONTROLLER_SAMPLE_TIME / 10;
        r[2 * k] = (real)(0.05 * cos(angle));
        r[2 * k + 1] = (real)(0.05 * sin(angle));
    }
}

int main(void) {
    real y[CONTROLLER_OUTPUTS], r[CONTROLLER_PREVIEW * CONTROLLER_OUTPUTS], u[CONTROLLER_INPUTS] = {0};
    unsigned long refused = 0;
    int deaf = 0;
    long t;

    controller_init(&self);
    controller_reset(&self, u); /* the inputs under which the robot rests now */
    for (t = 0; board_tick(); ++t) {
        mpc_info info;
        board_measure(y);
        wanted(t, r);
        controller_step(&self, y, r, u);
        board_pull(u); /* at once: nothing slow between measuring and this */

        info = controller_info(&self);
        deaf = info.refused > refused ? deaf + 1 : 0;
        refused = info.refused;
        if (deaf >= DEAF) break;
    }
    board_stop(controller_info(&self));
    return 0;
}
"""
BOARD_H = r"""
#ifndef BOARD_H
#define BOARD_H

#include "controller.h"

int board_tick(void);                            /* returns every CONTROLLER_SAMPLE_TIME seconds; 0: enough */
void board_measure(real y[CONTROLLER_OUTPUTS]);  /* m; NAN where the sensor has nothing */
void board_pull(const real u[CONTROLLER_INPUTS]); /* N, held until the next call */
void board_stop(mpc_info info);

#endif
"""

# Yours are a timer, a sensor and three winches. Here: each axis of the tip as an oscillator of 0.73 Hz, for 10 s, with
# a sensor that is blind for three samples.

BOARD_C = r"""
#include <math.h>
#include <stdio.h>

#include "board.h"

static const double gain[2][3] = {{0.0056, -0.0028, -0.0028}, {0.0, 0.0049, -0.0049}}; /* m/N */
static double place[2], speed[2], squares;
static int ticks, settled;

int board_tick(void) { return ticks++ < 200; }

void board_measure(real y[CONTROLLER_OUTPUTS]) {
    int i;
    for (i = 0; i < 2; ++i) y[i] = ticks > 60 && ticks <= 63 ? (real)NAN : (real)place[i];
}

void board_pull(const real u[CONTROLLER_INPUTS]) {
    const double step = 1e-3, frequency = 4.6, damping = 0.08;
    const double angle = 6.283185307179586 * ticks * (double)CONTROLLER_SAMPLE_TIME / 10;
    double time;
    int i, j;
    for (time = 0; time < (double)CONTROLLER_SAMPLE_TIME - step / 2; time += step)
        for (i = 0; i < 2; ++i) {
            double pull = -place[i];
            for (j = 0; j < 3; ++j) pull += gain[i][j] * (double)u[j];
            speed[i] += step * (frequency * frequency * pull - 2 * damping * frequency * speed[i]);
            place[i] += step * speed[i];
        }
    if (ticks > 100) {
        squares += pow(place[0] - 0.05 * cos(angle), 2) + pow(place[1] - 0.05 * sin(angle), 2);
        ++settled;
    }
}

void board_stop(mpc_info info) {
    printf("%lu steps; RMSE after 5 s %.2f mm\n", info.steps, 1e3 * sqrt(squares / settled));
    printf("%lu clipped, %lu held, %lu measurements refused, at most %d iterations\n", info.clipped, info.held,
        info.refused, info.worst_iterations);
}
"""


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/tutorial-3")
    folder.mkdir(parents=True, exist_ok=True)

    # 1. A run folder is all that is needed, on another computer, too. Without one: six trials of tutorial 1's study,
    # the first of them with the theta that fits 20 s of probing.

    if len(sys.argv) > 2:
        run = Path(sys.argv[2])
    else:
        run = folder / "run"
        identified = identify(study.mpc.model, probe(study.plant, study.mpc.input_bounds))
        replace(study, seed_points=3, iterations=3, initial=[identified]).run(run, resume=True)

    # 2. The best controller of the run as C99: it allocates nothing, has no recursion and no global state. The export
    # builds it at once and replays the run's best episode, and random samples that mostly run into the bounds.

    double, single = folder / "double", folder / "float"
    shell(f"socasadi export {run} --out {double}")
    shell(f"ls {double}")

    # controller.h, controller.c   the interface: init, reset, step, info; all that your code includes
    # controller_data.h            every number, and where it comes from; another theta changes this file alone
    # mpc.[ch], qp.[ch], qp_residual.c, real.h
    #                              observer and checks, solver, optimality conditions, the number type
    # replay.c, vectors.h          the test; not for the firmware
    # example.c, Makefile, CMakeLists.txt, README.md
    #
    # The folder needs neither Python nor this package. Whoever gets it says:

    if c_compiler() is None or shutil.which("make") is None:
        sys.exit("there is no C compiler, or no make: install them to go on (apt-get install gcc make)")
    shell(f"make -s -C {double} test")

    # "passed" means: each input is what Python computed, up to the difference that is named, a share of the input bound
    # of 10 N. "clipped" and "held" count the samples at which the solver had no proven answer: 0, or ask why.

    # 3. In float. A Cortex-M4F computes in float only (double would be software), an M7 in both. What float costs in
    # accuracy is measured by the same test. It refuses a controller for which it is too much.

    shell(f"socasadi export {run} --out {single} --real float")

    # 4. What it costs there. The whole episode is flown with the compiled controller on an emulated Cortex-M4F.

    if missing := toolchain():
        print(f"\nskipped, socasadi emulate: {missing}")
    else:
        shell(f"socasadi emulate {run}")

    # How to read it, with what came out when this was written:
    #
    # flash 19.2 kB              code and tables of the controller, without your firmware
    # RAM 6.6 kB                 its one struct; nothing is allocated later
    # stack 352 bytes            at the deepest
    # of the episode             18,522 instructions a step, always, for no bound became active
    # random samples, too        526,263 at worst, with 31 changes of the working set: size the timer for this line
    #
    # Instructions are counted exactly; they are not cycles. Allow two cycles each and a clock of 100 MHz: 0.4 ms in the
    # median and 10.5 ms at worst, of a sample time of 50 ms. Where that is too long: LinearMPC(iteration_limit=20),
    # then the clipped unconstrained law takes over; a shorter horizon or move blocking (control_horizon=4); or
    # Study(conditions=(IterationBound(40),)), which tries no theta that needs more.

    # 5. The loop around it. Yours is `firmware.c` with another `board.c`.

    for name, text in {"firmware.c": FIRMWARE, "board.h": BOARD_H, "board.c": BOARD_C}.items():
        (folder / name).write_text(text.lstrip())
    sources = " ".join(str(single / name) for name in ("controller.c", "mpc.c", "qp.c", "qp_residual.c"))
    flags = "-std=c99 -O2 -ffp-contract=off -Wall -Wextra -Wconversion"
    program = f"{folder / 'firmware.c'} {folder / 'board.c'} {sources}"
    shell(f"{' '.join(c_compiler() or [])} {flags} -I{folder} -I{single} {program} -lm -o {folder / 'firmware'}")
    shell(f"{folder.resolve() / 'firmware'}")

    # The three measurements that never came were "refused": the observer predicted without them, and u went on. Things
    # to get right on your board:
    #
    # - measure, step, pull, in this order and without a pause; where the step takes a good part of the sample time,
    #   pull at the next tick instead and tune with LinearMPC(delay=1).
    # - controller_init once, controller_reset before each start, with the inputs under which the robot rests.
    # - units are those of the study, metres and newtons here. The struct belongs to one caller: never step it from a
    #   thread and an interrupt at once.
    # - no -ffast-math: the checks rely on NaN.
    # - a new theta of the same study: replace controller_data.h, and flash again.
    #
    # Trials of a campaign can be flown by the board itself, too: runs/tutorial-2/runs/arm/controller-c of tutorial 2
    # holds this controller with `experiment.c`, which prints the recording that `socasadi tell` reads.


if __name__ == "__main__":
    main()
