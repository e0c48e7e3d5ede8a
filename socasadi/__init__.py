"""Closed-loop Bayesian tuning of model predictive controllers for soft robots, from Cosserat rod to embedded C.

    Rod -> SimulatedPlant -> Study -> Result -> C

A :class:`Study` searches for the parameters theta of a linear prediction model with which a constrained
:class:`LinearMPC` performs a task best on a plant; its :class:`Result` exports that controller as C. The method starts
from Pal, He and Wei, "Sample-efficient Model Predictive Control Design of Soft Robotics by Bayesian Optimization"
(arXiv 2210.08780).

Names and the paper's symbols:

==========================  ===========  =======================================================
name                        symbol       meaning, unit
==========================  ===========  =======================================================
``theta``                   theta        entries of the prediction model
``tension``, ``u``          u            cable tensions, N; positive pulls
``y``, ``output``           y            measured outputs, m
``reference``, ``r``        r            wanted outputs, m
``horizon``                 N            prediction horizon, samples
``Q``, ``R``                Q, R         weights of outputs and input term
``J``                       J            cost of an episode
``young``, ``poisson``      E, nu        Young's modulus, Pa; Poisson's ratio
``density``, ``damping``    rho, eta     kg/m3; Kelvin-Voigt damping, Pa s
``length``, ``radius``      L, r         of the rod and its section, m
``strain``                  xi           [kx ky kz sx sy sz], 1/m and 1, in the body frame
``sample_time``             T            s
``seed_points``             n_0          experiments before the first model of J
==========================  ===========  =======================================================
"""

from .campaign import (
    Campaign,
    Circle,
    ClosedLoopStability,
    Cost,
    IterationBound,
    Origin,
    Overshoot,
    Pulse,
    Result,
    SettlingTime,
    Study,
    Task,
    ViolatedOutputs,
)
from .model import Dense, Modal
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
    "SettlingTime",
    "SimulatedPlant",
    "Study",
    "Task",
    "ViolatedOutputs",
]
