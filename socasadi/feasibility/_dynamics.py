"""Can a controller of this make do it: what the cost asks for, how fast, how often, and through how much noise."""

from dataclasses import replace

import numpy as np

from ..campaign import Cost
from ..mpc import weight_matrix
from ..plant import PlantFailure, SimulatedPlant
from ._case import Case, percent
from ._finding import Finding

_FOLLOWED, _TRAPPED = 0.95, 0.8
"""Shares of the way that the cost's own optimum goes: ``ok`` from the first, ``infeasible`` below the second."""
_EXACT = 0.995
_SMALLEST = -8.0
"""Logarithm of the smallest factor on R that is tried."""
_HOPELESS = 1.5
"""Share of the input bound from which on a reference is too fast."""
_SAMPLES_A_PERIOD = (4.0, 10.0)
_LOUD = (0.2, 0.5)
"""Noise (standard deviation of a distance) as a share of what is asked for: doubtful, and infeasible, from there."""
_THROWN = 0.5
"""Share of an arm's length by which no pulse is meant to push its tip."""
_SCATTER = 0.2
"""Standard deviation of J from flight to flight, as a share of J, from which on trials cannot be told apart."""


def following(case: Case) -> list[Finding]:
    """What share of the input bound does it take to follow the reference as fast as it moves, and who would pay it?"""
    if not case.asked:
        return []
    findings = _speed(case) if case.holds else []
    if any(finding.verdict == "infeasible" for finding in findings):
        return findings
    mpc, cost = case.study.mpc, case.study.cost
    findings.append(_weighed(case, cost, "cost weights"))
    own = Cost(Q=mpc.Q, R=mpc.R, input_term=mpc.input_term)
    same = case.best_flight(own) is case.best_flight(cost)
    return findings if same else [*findings, _weighed(case, own, "MPC weights")]


def timing(case: Case) -> list[Finding]:
    """Do sample time and horizon fit the first mode?"""
    mpc = case.study.mpc
    frequency, ratio = case.robot.slowest(case.rest)
    if not frequency:
        return []  # not stable at rest, which is said elsewhere
    # Of a mode that does not swing the slow time constant counts, as an oscillation that would be as slow.
    period = (ratio + np.sqrt(ratio**2 - 1)) / frequency if ratio >= 1 else 1 / frequency
    samples, seen = period / mpc.sample_time, mpc.horizon * mpc.sample_time / period
    mode = f"the first mode has {frequency:.3g} Hz and a damping ratio of {ratio:.2g}"
    says = f"{mode}: {samples:.3g} samples a period"
    few, enough = _SAMPLES_A_PERIOD
    if samples >= enough:
        findings = [Finding("sample time", "ok", says)]
    else:
        advice = f"a sample time of {period / enough:.2g} s or less"
        findings = [Finding("sample time", "doubtful" if samples >= few else "infeasible", says, advice)]
    says = f"{mpc.horizon} samples are {seen:.2g} of its period"
    if mpc.terminal is not None:
        findings.append(Finding("horizon", "ok", f"{says}; what comes after is in the terminal cost"))
    elif seen >= 0.5:
        findings.append(Finding("horizon", "ok", says))
    else:
        advice = f"terminal='riccati', or a horizon of {round(0.5 * samples)} samples"
        findings.append(Finding("horizon", "doubtful", f"{says}, and no terminal cost stands for the rest", advice))
    return findings


def noise(case: Case) -> list[Finding]:
    """What does the sensor's noise leave to be seen, and what floor does it put under J?"""
    if case.noise is None:
        return [Finding("noise", "unknown", "nothing is known of the sensor's noise", "bring a probing record")]
    mpc, cost = case.study.mpc, case.study.cost
    Q, samples = weight_matrix(cost.Q, mpc.outputs, "Q of the cost"), len(case.reference) - 1
    floor, best = samples * float(np.trace(Q)) * case.noise**2, case.best_flight(cost).J
    spread = float(np.sqrt(2 * samples * np.sum(Q**2))) * case.noise**2
    says = f"{case.length(case.noise)} of it puts a floor of {floor:.3g} under J, beside {best:.3g} of the best flight"
    share = case.noise * np.sqrt(mpc.outputs) / case.asked if case.asked else 0.0
    if case.noise > case.moved > 0:
        says += f"; that is more than the {case.length(case.moved)} that the robot can move"
        return [Finding("noise", "infeasible", says, "a better sensor")]
    if share > _LOUD[0]:
        says += f"; a measurement is off by {percent(share)} of the {case.length(case.asked)} that the task asks for"
        return [Finding("noise", "infeasible" if share > _LOUD[1] else "doubtful", says, "a better sensor")]
    says += f", and moves J by {spread:.2g} from flight to flight"
    if spread > _SCATTER * (floor + best):
        return [Finding("noise", "doubtful", says, "a better sensor, or a longer or larger task")]
    return [Finding("noise", "ok", says)]


def pulse(case: Case) -> list[Finding]:
    """How far does the task's disturbance push the robot if nothing answers it?"""
    given, robot = case.study.task.pulse, case.of_a_rod
    if given is None or robot is None:
        return []
    mpc, frequency = case.study.mpc, case.robot.slowest(case.rest)[0]
    plant = SimulatedPlant(robot.rod, mpc.sample_time, 0.0, robot.plant.output, robot.plant.substep)
    # From where it rests: what it does elsewhere is alike, and nothing has to be held there.
    still = plant.reset(tension_bounds=mpc.input_bounds)
    says = f"a pulse of {np.linalg.norm(given.force):.3g} N for {given.duration:g} s"
    try:
        pushed = given.samples(mpc.sample_time, case.study.task.samples(mpc.sample_time))
        after = round(1 / ((frequency or 1.0) * mpc.sample_time))
        forces = [given.force] * pushed + [(0.0, 0.0, 0.0)] * after
        seen = [plant.step(plant.tension, force) - still for force in forces]
    except PlantFailure as error:
        return [Finding("pulse", "infeasible", f"{says} throws the arm: {error.reason}", "a weaker or shorter pulse")]
    far = float(np.linalg.norm(seen, axis=1).max())
    says += f" pushes the outputs by {case.length(far)} if nothing answers it"
    if far > _THROWN * robot.rod.length and case.units.output == "m":
        says += f", of an arm of {case.length(robot.rod.length)}"
        return [Finding("pulse", "infeasible", says, "a weaker or shorter pulse")]
    limits = mpc.output_limits
    room = np.inf if limits is None else min((case.reference - limits[0]).min(), (limits[1] - case.reference).min())
    if far <= room:
        return [Finding("pulse", "ok", says)]
    says += f"; the reference keeps {case.length(max(room, 0.0))} away from the output bounds"
    return [Finding("pulse", "doubtful", says, "a weaker pulse, or wider output_bounds: they are soft, and will break")]


def _speed(case: Case) -> list[Finding]:
    mpc = case.study.mpc
    frequency, _ = case.robot.slowest(case.rest)
    skipped = int(case.settled.argmax()) * mpc.sample_time
    lighter = _lighter(case, case.study.cost, _EXACT)
    if lighter is None or not frequency or skipped < 1 / frequency:
        return []  # the jump at the start is not over
    flight = case.best_flight(lighter[1])
    # A robot that only pulls cannot fly this very flight, for it has no bounds: what counts is by how much its inputs
    # are larger than those that would do if the reference stood still.
    A, B, C, D = case.linear
    gain = C @ np.linalg.solve(np.eye(len(A)) - A, B) + D
    standing = (case.reference[1:] - case.rest.output)[case.settled] @ np.linalg.pinv(gain).T
    moving = (flight.input - case.rest.input)[case.settled]
    largest = float(np.linalg.norm(standing, axis=1).max())
    times = float(np.linalg.norm(moving, axis=1).max()) / largest if largest else 1.0
    share = case.effort * max(times, 1.0)
    says, advice = f"following the reference as fast as it moves takes {percent(share)} of the input bound", ""
    if mpc.rate_limits is not None:
        rates = np.diff(moving, axis=0) / mpc.sample_time
        allowed = np.where(rates > 0, mpc.rate_limits[1], -mpc.rate_limits[0])
        hasty = float(np.max(np.abs(rates) / np.maximum(allowed, 1e-12)))
        says += f" and {percent(hasty)} of the rate bound"
        if hasty > max(share, 1):
            share, advice = hasty, "a slower reference, or larger rate_bounds"
    if share <= 1:
        return [Finding("speed", "ok", says)]
    verdict = "infeasible" if share > _HOPELESS else "doubtful"
    return [Finding("speed", verdict, says, advice or "a slower reference, or larger input_bounds")]


def _weighed(case: Case, cost: Cost, name: str) -> Finding:
    share = case.followed(case.best_flight(cost))
    says = f"the flight of least cost goes {percent(share)} of the way that the task asks for"
    if share >= _FOLLOWED:
        return Finding(name, "ok", says)
    lighter = _lighter(case, cost, _FOLLOWED)
    advice = (
        f"R {_times(1 / lighter[0])} times smaller" if lighter else "a task or inputs that fit each other: no R does"
    )
    if cost.input_term != "rate":
        what = "in newtons" if cost.input_term == "literal" else "in shares of its bound"
        says += f": R weighs the input {what}, and not to move is cheap"
        advice = f"input_term='rate', or {advice}"
    return Finding(name, "infeasible" if share < _TRAPPED else "doubtful", says, advice)


def _lighter(case: Case, cost: Cost, share: float) -> tuple[float, Cost] | None:
    """The cost with just so small an R that its optimum goes that share of the way, and the factor on R, if any has."""
    R = np.asarray(cost.R, dtype=float)

    def scaled(exponent: float) -> Cost:
        return replace(cost, R=10.0**exponent * R)

    if case.followed(case.best_flight(cost)) >= share:
        return 1.0, cost
    low, high = _SMALLEST, 0.0
    if case.followed(case.best_flight(scaled(low))) < share:
        return None
    while high - low > 0.05:
        middle = (low + high) / 2
        low, high = (middle, high) if case.followed(case.best_flight(scaled(middle))) >= share else (low, middle)
    return 10.0**low, scaled(low)


def _times(factor: float) -> str:
    """A factor as it is told: two digits."""
    return f"{float(f'{factor:.2g}'):,.0f}" if 10 <= factor < 1e5 else f"{factor:.2g}"
