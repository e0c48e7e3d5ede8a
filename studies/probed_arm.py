"""The circle again, the way the comparison recommends: probe, identify, and tune the rest of the controller in flight.

    pip install -e '.[identification]'
    socasadi run studies/probed_arm.py

Forty seconds of random steps give the prediction model (N4SID), which is then left alone. theta is three numbers:
factors on R, and on what the observer assumes of unknown inputs and of the disturbance. Five seed points and 25
iterations are enough for them. See "Would you have got there without" in README.md.
"""

from socasadi import Circle, Cost, Fixed, LinearMPC, Rod, SimulatedPlant, Study
from socasadi.campaign import probe
from socasadi.model import subspace

plant = SimulatedPlant(Rod.preset("paper"), sample_time=0.05, noise=1e-3)
bounds = (-10, 10)
model = Fixed.of(subspace(probe(plant, bounds, duration=40.0, hold=1.0)), plant.sample_time)

study = Study(
    plant=plant,
    mpc=LinearMPC(
        model,
        sample_time=plant.sample_time,
        horizon=20,
        Q=1e3,
        R=1.0,
        input_bounds=bounds,
        output_bounds=(-0.1, 0.1),
        tuned=("R", "input_noise", "disturbance_noise"),
    ),
    task=Circle(radius=0.05, period=20.0),
    cost=Cost(Q=1e3, R=1.0, input_term="rate"),
    seed_points=5,
    iterations=25,
    initial=[(1.0, 1.0, 1.0)],
)

if __name__ == "__main__":
    result = study.run("runs/probed_arm", resume=True)
    print(result.best.theta, result.best.J)
