"""The circle again, for an arm of which next to nothing is known: not even on which side of it each cable runs.

    socasadi run studies/unknown_arm.py

The gains of all six pairs of cable and axis may have either sign, up to twice what the strongest would be, in a box
thousands of times larger than the data sheet's in circle.py. Sobol points hardly ever hit anything good here.
"""

from socasadi import Circle, Cost, LinearMPC, Modal, Rod, SimulatedPlant, Study

study = Study(
    plant=SimulatedPlant(Rod.preset("paper"), sample_time=0.05, noise=1e-3),
    mpc=LinearMPC(
        Modal(), sample_time=0.05, horizon=10, Q=1e3, R=1.0, input_bounds=(-10, 10), output_bounds=(-0.1, 0.1)
    ),
    task=Circle(radius=0.05, period=20.0),
    cost=Cost(Q=1e3, R=1.0, input_term="rate"),
    seed_points=10,
    iterations=100,
)

if __name__ == "__main__":
    result = study.run("runs/unknown_arm", resume=True)
    print(result.best.theta, result.best.J)
