"""Would you have got there without Bayesian optimisation: twenty-three ways to a controller at equal cost.

    socasadi compare studies/compare.py --smoke       does it work: under two minutes
    socasadi compare studies/compare.py --quick       three seeds, 30 episodes' worth of the robot's time
    socasadi compare studies/compare.py               ten seeds, 110 episodes' worth; goes on where it was stopped
    socasadi compare studies/compare.py --seeds 3     the same of three seeds, which are the first of the ten

All methods are lent the same simulated arm for the same time, and their controllers are flown under noise that none has
seen. What predicts looks 20 samples ahead. The first method is the one that the others are compared with.
"""

from dataclasses import replace

from circle import study as circle

from socasadi import Circle, FigureEight, Origin, Pulse, Rod, SetPoints, SimulatedPlant
from socasadi.baselines import (
    PID,
    Comparison,
    DeadCable,
    DeePC,
    Delayed,
    HInfinity,
    Identified,
    IterativeLearning,
    Koopman,
    Linearised,
    Loaded,
    Misrouted,
    ModelSearch,
    Noisier,
    NonlinearMPC,
    Rubbing,
    Softer,
    Subspace,
    WeightSearch,
)
from socasadi.rod import Payload

study = replace(circle, mpc=replace(circle.mpc, horizon=20))
loaded = SimulatedPlant(replace(Rod.preset("paper"), payloads=Payload(0.1)), sample_time=0.05, noise=1e-3)
push = Pulse(time=8.0, duration=4.0, force=(0.0, 0.1, 0.1))  # moves the tip by 15 mm, if nothing is done
stairs = ((0.02, 0.0), (0.04, 0.0), (0.06, 0.0), (0.03, 0.03))

# Robots beside its own for which a controller is tuned as well, where it is tuned for robustness: none of those on
# which it is judged.
OTHERS = (Softer(young=0.75), Softer(young=1.25), Misrouted(1.25))

# What the observer may be tuned to assume at the least where the arm may change, as shares of what it assumes untuned:
# the less it assumes, the more the model is trusted.
CAREFUL = ("R", ("input_noise", 0.1, 100.0), ("disturbance_noise", 0.1, 100.0))

comparison = Comparison(
    study=study,
    tasks={
        "circle": Circle(radius=0.05, period=20.0),
        "origin": Origin(tip=(-0.01, 0.04)),
        "eight": FigureEight(width=0.05, height=0.025, period=20.0),
        "stairs": SetPoints(points=stairs, hold=5.0),
        "80 mm": SetPoints(points=((0.08, 0.0),)),
        "payload": replace(study, plant=loaded),
        "pushed": Circle(radius=0.05, period=20.0, pulse=push),
    },
    methods={
        "socasadi": WeightSearch(flights=3),
        "socasadi (Sobol)": WeightSearch(flights=3, kind="sobol"),
        "socasadi (random)": WeightSearch(flights=3, kind="random"),
        "socasadi (careful)": WeightSearch(flights=3, tuned=CAREFUL),
        "for the worst": WeightSearch(flights=3, over=OTHERS, by="worst"),
        "for the mean": WeightSearch(flights=3, over=OTHERS, by="mean"),
        "model search": ModelSearch(),
        "Sobol": ModelSearch("sobol"),
        "random": ModelSearch("random"),
        "identified": Identified(),
        "N4SID": Subspace(),
        "weights": WeightSearch(),
        "PID": PID(),
        "H-infinity": HInfinity(),
        "Koopman": Koopman(),
        "DeePC": DeePC(),
        "velocity DeePC": DeePC(velocity=True),
        "ILC": IterativeLearning(),
        "ILC (untuned)": IterativeLearning(Subspace()),
        "linearised": Linearised(),
        "linearised (tuned)": WeightSearch("linearised"),
        "nonlinear MPC": NonlinearMPC(),
        "constant curvature": NonlinearMPC("constant curvature", doubt=1.0),
    },
    elsewhere={
        "E -20 %": Softer(young=0.8),
        "E +20 %": Softer(young=1.2),
        "damping -20 %": Softer(damping=0.8),
        "damping +20 %": Softer(damping=1.2),
        "100 g at the tip": Loaded(0.1),
        "cable 1 at 24 mm": Misrouted(1.2),
        "noise x 3": Noisier(3.0),
        "cable 1 dead": DeadCable(0),
        "friction 0.3": Rubbing(0.3),
        "1 sample late": Delayed(1),
    },
    elsewhere_on=("circle", "pushed"),
    shown=("socasadi", "model search", "N4SID", "PID", "H-infinity", "Koopman", "DeePC", "nonlinear MPC"),
)
