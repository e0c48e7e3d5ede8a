"""Tutorial 2: tune the controller of a robot of your own, which Python cannot move.

At the end you have flown a campaign of eight trials from the shell, as two people would in a lab, with a failure, a log
in the wrong unit and a slip that was taken back; and the tuned controller as C. It takes about 15 s.

    python studies/tutorial_2_own_robot.py [FOLDER]

in a checkout; read along here. All that it writes is in FOLDER, runs/tutorial-2 if you name none, which must not be
there yet. What the commands say is in SI units; only errors are printed in millimetres.

There is no robot here, so one is simulated. Nothing but the two functions `probe` and `fly` below touches it, and they
do what a script in your lab would: move it, and write a CSV file.
"""

import csv
import json
import os
import sys
from pathlib import Path

import numpy as np
from shell import shell

from socasadi import Rod, SimulatedPlant, Study
from socasadi.campaign import load_study
from socasadi.rod import Cable, Material, Section, Strain

# The stand-in: an arm that differs from its data sheet below as a real one would, 15 % softer, a little heavier, with
# cables a few degrees off their places. From here on we forget what it is made of.

cables = [Cable((0.02 * np.cos(angle), 0.02 * np.sin(angle))) for angle in np.radians([4, 117, 242])]
silicone = Material(young=0.85e6, poisson=0.5, density=1050, damping=0.9e4)
bending = Strain(bending_y=2, bending_z=2, torsion=0, stretch=0)
robot = SimulatedPlant(Rod(length=0.6, section=Section.circle(0.03), material=silicone, strain=bending, cables=cables))

# 1. The study: what is asked of the robot. `ExternalPlant` says only how many inputs and outputs it has and how often
# they come; your robot may be anything. The model's box is made of the data sheet's four numbers. Eight trials are for
# this tutorial. For real take ten seed points and 30 iterations, 40 trials of 10 s, and more while J still falls
# (socasadi init arm.py --resume --iterations 60).

ARM = """
from socasadi import Circle, Cost, ExternalPlant, LinearMPC, Modal, Study

arm = ExternalPlant(sample_time=0.05, inputs=3, outputs=2, name="the arm in room 12")
model = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)
mpc = LinearMPC(model, sample_time=0.05, horizon=10, Q=1e3, R=1.0, input_bounds=(-10, 10), output_bounds=(-0.1, 0.1))
task = Circle(radius=0.05, period=10.0, duration=10.0)
study = Study(plant=arm, mpc=mpc, task=task, cost=Cost(Q=1e3, R=1.0), seed_points=5, iterations=3)
"""

# The data sheet of the arm, for the check. More may stand in it: radius, cable_angles, damping_ratio, poisson, gravity,
# noise (see socasadi.feasibility.read_spec_sheet).

SHEET = """
length = 0.6              # m
bending_stiffness = 0.64  # N m2: E I, or force on the tip times L^3 / 3 over the sag of the arm
mass_per_length = 2.8     # kg/m
cable_offset = 0.02       # m from the axis
"""

# 2. The lab's script. Two experiments: one that shakes the robot, open-loop, and one that flies a trial's controller.
# Both write a line a sample: the time, what was measured then, and the inputs held from then on. (`fly` also writes the
# reference. It need not, but a reference that does not match is how a wrong unit or a late clock is found out.)


def probe(path: str) -> None:
    """20 s of steps of half a second, every cable on its own, up to half of what it bears."""
    random, y, u = np.random.default_rng(0), robot.reset(seed=0), np.zeros(3)
    with open(path, "w") as log:
        print("t [s],y1 [m],y2 [m],u1 [N],u2 [N],u3 [N]", file=log)
        for k in range(401):
            if k % 10 == 0:
                u = random.uniform(-5, 5, 3)
            print(0.05 * k, *y, *u, sep=",", file=log)
            y = robot.step(u)


def fly(study: Study, number: int, path: str) -> None:
    """The task, with the controller that `socasadi ask` has laid out for a trial."""
    asked = json.loads(Path(f"runs/arm/asked/trial-{number:03}/theta.json").read_text())
    controller, task = study.mpc.controller(list(asked["theta"].values())), study.task
    meter = study.cost.meter(held=np.zeros(3), outputs=2, input_scale=study.mpc.input_scale)  # J so far
    y, u, give_up = robot.reset(seed=number), np.zeros(3), asked["give_up"] or np.inf
    with open(path, "w") as log:
        print("t,y1,y2,u1,u2,u3,r1,r2", file=log)
        for k in range(201):
            now, *ahead = task.reference(0.05 * (k + np.arange(11)))  # now, and the ten samples after
            proven = meter.add(y, now, u) if k else 0.0
            u = controller.step(y, ahead)
            print(0.05 * k, *y, *u, *now, sep=",", file=log)
            if proven > give_up:
                break
            y = robot.step(u)


# A lab without Python on the robot's computer compiles the same controller instead: runs/arm/controller-c has it as C
# with the loop (experiment.c), and each trial's controller_data.h its numbers. Tutorial 3 is about that.


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/tutorial-2")
    if folder.exists():
        sys.exit(f"{folder} is there already: remove it to begin again, or name another folder")
    folder.mkdir(parents=True)
    os.chdir(folder)
    print(f"$ cd {folder}")
    Path("arm.py").write_text(ARM)
    Path("arm.toml").write_text(SHEET)

    # 3. Can it work? First from the data sheet alone, which takes nothing but a desk.

    shell("socasadi check arm.py --spec arm.toml")

    # Then 20 s of the robot itself. The record shows what no data sheet does: the noise of the sensor, the damping, how
    # well any model of this make can follow. Compare the two: the first mode is at 0.665 Hz instead of 0.742, and the
    # loop bears 2.6 times the gain instead of 9.7.

    probe("probe.csv")
    shell("socasadi check arm.py --spec arm.toml --record probe.csv")

    # 4. The campaign. From here on the folder runs/arm is all that is needed: it may be copied, shared, or left for a
    # month. The record is worth more than a check: the theta that fits it is a better first guess than any point of the
    # box, so the search starts from it. (Without a data sheet the record makes the box, too:
    # socasadi.model.bounds_from_record.)

    shell("socasadi init arm.py --record probe.csv")
    study = load_study(Path("arm.py"))  # for `fly`: the controller and the task

    # The first trial is the identified theta. Fly it, bring the recording.

    shell("socasadi ask runs/arm")
    fly(study, 1, "recording-1.csv")
    shell("socasadi tell runs/arm --trial 1 --csv recording-1.csv")

    # Two people, Ann and Bob, take one trial each. They may be back in any order; what is out is listed. "may end": a
    # trial need not be flown to its end once its J is proven to be ten times the best one; `fly` keeps count. (That
    # spares the robot, but does not guard it. Limits of your own on tip and winches do; what they stop is a failure.)

    shell("socasadi ask runs/arm --count 2")
    shell("socasadi ask runs/arm --pending")

    # Bob's cable slips. That is a result, too: the search learns where experiments fail, and keeps away from there.
    # (Tell only what the theta is to blame for. A flat battery is not: fly that trial again.)

    shell('socasadi tell runs/arm --trial 3 --failed "cable 2 slipped off its pulley"')

    # Ann's camera was set to millimetres. Nothing wrong is stored: the recording is refused, with the line.

    fly(study, 2, "recording-2.csv")
    heading, *rows = csv.reader(Path("recording-2.csv").read_text().splitlines())
    wrong = [[row[0], str(1e3 * float(row[1])), str(1e3 * float(row[2])), *row[3:]] for row in rows]
    Path("millimetres.csv").write_text("\n".join(",".join(row) for row in [heading, *wrong]))
    shell("socasadi tell runs/arm --trial 2 --csv millimetres.csv", refused=True)
    shell("socasadi tell runs/arm --trial 2 --csv recording-2.csv")

    # A recording can be mixed up with another trial's; that is noticed, too, for the inputs are not the controller's.

    shell("socasadi ask runs/arm")
    shell("socasadi tell runs/arm --trial 4 --csv recording-2.csv", refused=True)

    # 5. J may be computed elsewhere, as here, and told as a number. It is what `Cost` says: over all samples, 1e3 times
    # the squared error at the sample's end plus the squared change of each input, as a share of its bound of 10 N.

    fly(study, 4, "recording-4.csv")
    log = np.loadtxt("recording-4.csv", delimiter=",", skiprows=1)
    y, u, r = log[1:, 1:3], log[:-1, 3:6], log[1:, 6:8]
    J = 1e3 * np.sum((y - r) ** 2) + np.sum(np.diff(u / 10, axis=0, prepend=0) ** 2)

    # A slip of the decimal point is taken back; it stays in the journal.

    shell(f"socasadi tell runs/arm --trial 4 --cost {J / 10:.5g}")
    shell("socasadi tell runs/arm --trial 4 --take-back")
    shell(f"socasadi tell runs/arm --trial 4 --cost {J:.5g}")

    # 6. And so on to the end. The five seed points were the identified theta and four spread over the box; from now on
    # they are where a Gaussian process of J expects the most improvement.

    for number in range(5, 9):
        shell("socasadi ask runs/arm")
        fly(study, number, f"recording-{number}.csv")
        shell(f"socasadi tell runs/arm --trial {number} --csv recording-{number}.csv")

    # 7. What was found: a table for a spreadsheet, a summary, and the C for the robot's computer. Eight trials find
    # nothing better than the identified theta, at about 7.6. Forty do not on this stand-in, either: flown again, their
    # best costs 7.7. Without the probing record forty trials in the data sheet's box come to 7.7, too; the first eight
    # of them had come to 10.3. So probe first where you can; the search is for what a linear fit of 20 s does not see.
    #
    # The best of noisy costs is also the luckiest. With more trials `show` says what it is worth without that luck;
    # eight in ten parameters are too few, and it says so. Fly the exported controller a few times more before you quote
    # its J. A record of 40 s is enough for more than a first theta: see probed_arm.py.

    shell("socasadi show runs/arm --csv trials.csv")
    shell("socasadi show runs/arm")
    shell("socasadi export runs/arm --out build")


if __name__ == "__main__":
    main()
