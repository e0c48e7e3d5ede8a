"""The circle again, the way the comparison recommends: probe, fly, identify, and tune the rest of the controller.

    pip install -e '.[identification]'
    socasadi run studies/probed_arm.py       the campaign
    python studies/probed_arm.py             that and two others, and what they are worth where the arm is disturbed

Forty seconds of random steps give a prediction model (N4SID), three flights of its controller the gains along the task.
The model is then left alone, and theta is three numbers: factors on R, and on what the observer assumes of unknown
inputs and of the disturbance, so far down that the model is all but believed. Five seed points and 25 iterations are
enough for them.

What is tuned where nothing disturbs believes that nothing does. The table that the second command prints says what that
gains, and what it costs on an arm that is pushed or has become softer; beside it, for an arm that may be, one that must
not believe its model that much, and one that is pushed while it is tuned. See "Would you have got there without" in
README.md.
"""

from dataclasses import replace

import numpy as np

from socasadi import Circle, Cost, Fixed, LinearMPC, Pulse, Rod, SimulatedPlant, Study
from socasadi.baselines import Softer, worth_elsewhere
from socasadi.campaign import fly, probe
from socasadi.model import subspace

plant = SimulatedPlant(Rod.preset("paper"), sample_time=0.05, noise=1e-3)
bounds = (-10, 10)
task = Circle(radius=0.05, period=20.0)
push = Pulse(time=8.0, duration=4.0, force=(0.0, 0.1, 0.1))  # moves the tip by 15 mm, if nothing is done
pushed = replace(task, pulse=push)
record = probe(plant, bounds, duration=40.0, hold=1.0)

untuned = LinearMPC(
    Fixed.of(subspace(record), plant.sample_time),
    sample_time=plant.sample_time,
    horizon=20,
    Q=1e3,
    R=1.0,
    input_bounds=bounds,
    output_bounds=(-0.1, 0.1),
)
first = untuned.controller(())
episodes = [fly(plant, first, task, seed=seed, time_limit=60.0) for seed in (1, 2, 3)]
flights = [episode.record for episode in episodes if episode.failure is None]

study = Study(
    plant=plant,
    mpc=replace(
        untuned,
        model=Fixed.of(subspace(record, flights=flights), plant.sample_time),
        tuned={"R": (0.01, 100), "input_noise": (1e-4, 100), "disturbance_noise": (1e-4, 100)},
    ),
    task=task,
    cost=Cost(Q=1e3, R=1.0, input_term="rate"),
    seed_points=5,
    iterations=25,
    initial=[(1.0, 1.0, 1.0)],
)

doubting = {"R": (0.01, 100), "input_noise": (0.3, 100), "disturbance_noise": (0.3, 100)}
studies = {
    "tuned": study,
    "tuned-doubting": replace(study, mpc=replace(study.mpc, tuned=doubting)),
    "tuned-pushed": replace(study, task=pushed),
}
arms = {"as it is": Softer(), "E -20 %": Softer(young=0.8)}

if __name__ == "__main__":
    controllers = {"untuned": first}
    for name, made in studies.items():
        result = made.run(f"runs/probed_arm-{name}", resume=True)
        controllers[name] = made.mpc.controller(result.chosen.theta)
    print(f"\nmedian J of 5 flights{'undisturbed':>20}{'pushed':>20}\n{'':21}" + f"{'as it is':>10}{'E -20 %':>10}" * 2)
    for name, controller in controllers.items():
        flown = [worth_elsewhere(replace(study, task=told), controller, 5, arms) for told in (task, pushed)]
        print(f"{name:21}" + "".join(f"{np.median(on.J):10.4g}" for worth in flown for on in worth.values()))
