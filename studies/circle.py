"""Scenario 2 of the paper: the tip of the soft arm follows a circle of 50 mm radius.

    socasadi run studies/circle.py

Ten seed points and a hundred iterations of Bayesian optimisation over the ten numbers of a modal prediction model.
"""

from socasadi import Circle, Cost, LinearMPC, Modal, Rod, SimulatedPlant, Study

rod = Rod.preset("paper")
plant = SimulatedPlant(rod, sample_time=0.05, noise=1e-3)
mpc = LinearMPC(
    Modal(),
    sample_time=0.05,
    horizon=10,
    Q=1e3,
    R=1.0,
    input_term="rate",
    input_bounds=(-10, 10),
    output_bounds=(-0.1, 0.1),
)
study = Study(
    plant=plant,
    mpc=mpc,
    task=Circle(radius=0.05, period=20.0),
    cost=Cost(Q=1e3, R=1.0, input_term="rate"),
    seed_points=10,
    iterations=100,
)

if __name__ == "__main__":
    result = study.run("runs/circle", resume=True)
    print(result.best.theta, result.best.J)
