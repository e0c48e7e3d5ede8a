from socasadi import Circle, Cost, LinearMPC, Modal, Rod, SimulatedPlant, Study

MODEL = Modal.from_spec(length=0.6, bending_stiffness=0.64, mass_per_length=2.8, cable_offset=0.02)


def study(*, rod=None, noise=1e-3, sample_time=0.05, task=None, cost=None, model=MODEL, plant=None, **mpc):
    """The circle on the preset "paper", with one thing or another changed."""
    return Study(
        plant=plant or SimulatedPlant(rod or Rod.preset("paper"), sample_time=sample_time, noise=noise),
        mpc=LinearMPC(model, sample_time=sample_time, **mpc),
        task=task or Circle(radius=0.05, period=20.0),
        cost=cost or Cost(),
    )


def verdicts(found):
    return {finding.name: finding.verdict for finding in found.findings}
