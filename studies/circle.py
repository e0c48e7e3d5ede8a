"""Scenario 2 of the paper: the tip of the soft arm follows a circle of 50 mm radius.

    socasadi run studies/circle.py

Ten seed points and a hundred iterations of Bayesian optimisation over the ten numbers of a modal prediction model.
"""

from socasadi import Circle, Cost, LinearMPC, Modal, Rod, SimulatedPlant, Study

plant = SimulatedPlant(Rod.preset("paper"), sample_time=0.05, noise=1e-3)

# What the arm's data sheet says, and beam formulas within a factor of two: the box in which theta is sought.
model = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)

mpc = LinearMPC(
    model,
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
