"""A small run of everything, for the page and the browser."""

from dataclasses import replace

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.campaign import assess

MODEL = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)


def small_run(folder):
    """A run with its Sobol baseline and flights under fresh noise."""
    study = Study(
        plant=SimulatedPlant(Rod.preset("paper")),
        mpc=LinearMPC(MODEL),
        task=Circle(radius=0.05, duration=6.0),
        seed_points=4,
        iterations=3,
        verifications=1,
    )
    result = study.run(folder, progress=None)
    replace(study, search="sobol").run(folder / "sobol", progress=None)
    assess(result)
    return result
