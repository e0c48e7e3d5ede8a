"""Closed-loop Bayesian tuning of model predictive controllers for soft robots, from Cosserat rod to embedded C.

    Rod -> SimulatedPlant -> Study -> Result -> C

A :class:`Study` searches for the parameters theta of a linear prediction model with which a constrained
:class:`LinearMPC` performs a task best on a plant; its :class:`Result` exports that controller as C. The method starts
from Pal, He and Wei, "Sample-efficient Model Predictive Control Design of Soft Robotics by Bayesian Optimization"
(arXiv 2210.08780).

The paper's symbols and the names in code, in ``socasadi`` itself or in one of its rooms (``socasadi.rod``,
``plant``, ``model``, ``mpc``, ``campaign``, ``tune``); what follows a function is its parameter:

============  ============================================  ======================================================
symbol        name                                          meaning, unit
============  ============================================  ======================================================
x1, x2        ``TipDisplacement``                           the tip across the arm, here called y and z, m
y = h(x, u)   ``Plant``, ``Plant.step``                     the robot, of which nothing else is known
y             ``Episode.output``                            its measured outputs, m
u             ``Plant.step.tension``, ``Episode.tension``   its inputs, cable tensions, N; positive pulls
r             ``Task.reference``, ``Episode.reference``     wanted outputs, m
z             ``PredictionModel.order``                     state of the prediction model, here called x: its size
A, B          ``StateSpace.A``, ``StateSpace.B``            z+ = A z + B u
C, D          ``StateSpace.C``, ``StateSpace.D``            y = C z + D u
theta         ``PredictionModel.entries``, ``Trial.theta``  what is open in A, B, C, D, and what it was in a trial
N             ``LinearMPC.horizon``                         prediction horizon, samples
Q             ``LinearMPC.Q``, ``Cost.Q``                   weight of the outputs: the MPC's own, and that of J
R             ``LinearMPC.R``, ``Cost.R``                   weight of the input term, likewise
u_min, u_max  ``LinearMPC.input_bounds``                    bounds of the inputs, hard, N
y_min, y_max  ``LinearMPC.output_bounds``                   bounds of the outputs, soft, m
J             ``Score.J``, ``Score.literal``                cost of an episode; as the paper writes it
J*            ``Result.best``, ``Result.best_estimated``    trial of the best J so far; without its noise
n_0           ``Study.seed_points``                         experiments before the first model of J
iterations    ``Study.iterations``                          experiments after them, at most
GP mean       ``Optimizer.mean``                            of the Gaussian process of J; the paper's is zero
GP kernel     ``Optimizer.kernel``                          its covariance; the paper's is Gaussian, "rbf"
GP noise      ``Optimizer.noise``                           variance of J's noise; the paper's is 0.01^2
EI            ``Optimizer.acquisition``                     expected improvement, "ei"; by default its logarithm
active set    ``Optimizer.active_set``                      most trials that the process is fitted to
E, nu         ``Material.young``, ``Material.poisson``      Young's modulus, Pa; Poisson's ratio
rho, eta      ``Material.density``, ``Material.damping``    density, kg/m3; Kelvin-Voigt damping, Pa s
L, r          ``Rod.length``, ``Section.circle.radius``     of the rod and its section, m
xi            ``Strain``                                    [kx ky kz sx sy sz], 1/m and 1, in the body frame
EI of a beam  ``Modal.from_spec.bending_stiffness``         Young's modulus times second moment of area, N m2
T             ``Plant.sample_time``                         sample time, s
============  ============================================  ======================================================
"""

from .campaign import (
    Campaign,
    Circle,
    ClosedLoopStability,
    Cost,
    FigureEight,
    IterationBound,
    Origin,
    Overshoot,
    Pulse,
    Result,
    SetPoints,
    SettlingTime,
    Study,
    Task,
    ViolatedOutputs,
)
from .model import Dense, Fixed, Modal
from .mpc import LinearMPC
from .plant import Camera, ExternalPlant, LaserSpot, Plant, SimulatedPlant
from .rod import Rod
from .tune import Optimizer

__all__ = [
    "Camera",
    "Campaign",
    "Circle",
    "ClosedLoopStability",
    "Cost",
    "Dense",
    "ExternalPlant",
    "FigureEight",
    "Fixed",
    "IterationBound",
    "LaserSpot",
    "LinearMPC",
    "Modal",
    "Optimizer",
    "Origin",
    "Overshoot",
    "Plant",
    "Pulse",
    "Result",
    "Rod",
    "SetPoints",
    "SettlingTime",
    "SimulatedPlant",
    "Study",
    "Task",
    "ViolatedOutputs",
]
