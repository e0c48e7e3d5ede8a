"""Scenario 1 of the paper: released from a bent pose, the soft arm's tip comes to the origin and stays there.

    socasadi run studies/origin.py

The tip starts at rest at (-10, 40) mm. With `pulse=Pulse(time=10, duration=0.2, force=(0, 0.5, 0))` in the task, a
force disturbs it on the way ("under perturbation" in the paper's figure).
"""

from socasadi import Cost, LinearMPC, Modal, Origin, Rod, SimulatedPlant, Study

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
    task=Origin(tip=(-0.01, 0.04)),
    cost=Cost(Q=1e3, R=1.0, input_term="rate"),
    seed_points=10,
    iterations=100,
)

if __name__ == "__main__":
    result = study.run("runs/origin", resume=True)
    print(result.best.theta, result.best.J)
