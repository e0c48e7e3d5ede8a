"""The circle again, the way the comparison recommends: probe, fly, identify, and tune the rest of the controller.

    pip install -e '.[identification]'
    socasadi run studies/probed_arm.py

Forty seconds of random steps give a prediction model (N4SID), three flights of its controller the gains along the task.
The model is then left alone, and theta is three numbers: factors on R, and on what the observer assumes of unknown
inputs and of the disturbance, so far down that the model is all but believed. Five seed points and 25 iterations are
enough for them. Where the arm may change, let the two of the observer end at 0.1: it will be trusted less. See "Would
you have got there without" in README.md, also for what such trust costs elsewhere.
"""

from dataclasses import replace

from socasadi import Circle, Cost, Fixed, LinearMPC, Rod, SimulatedPlant, Study
from socasadi.campaign import fly, probe
from socasadi.model import subspace

plant = SimulatedPlant(Rod.preset("paper"), sample_time=0.05, noise=1e-3)
bounds = (-10, 10)
task = Circle(radius=0.05, period=20.0)
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

if __name__ == "__main__":
    result = study.run("runs/probed_arm", resume=True)
    print(result.best.theta, result.best.J)
