"""Can the robot be where the task wants it: reach, bounds, what holding takes, and its own weight."""

import numpy as np

from ..campaign import Study
from ..rod import EquilibriumError
from ._case import CLOSE, Case, percent
from ._finding import Finding
from ._known import RodRobot
from ._reach import farthest, ray

_ANOTHER_UNIT = 100.0
_TURNS = 4.0
"""Turns of the tip from which on nobody means it."""
_TIGHT = 0.85
"""Share of the input bound from which on holding leaves too little to steer with."""
_NOISE_MARGIN = 3.0
_WEIGHT_MARGIN = 1.5
_STRAIGHT = 1e-3
"""Share of the length by which the tip of a straight rod may be off the axis."""


def curled(study: Study, robot: RodRobot) -> list[Finding]:
    """Is it so soft that its inputs would roll it up? Then a number is in another unit, and all else takes ages."""
    bounds = study.mpc.input_limits
    if robot.plant.output_unit != "m":
        return []
    try:
        rest = robot.pose(np.clip(robot.neutral, *bounds))
    except EquilibriumError:
        return []
    # A constant curvature k moves the tip by k L^2 / 2 while that is small, and turns it by k L.
    moved = float(np.linalg.norm(np.abs(rest.slope) @ np.max(np.abs(np.array(bounds) - rest.input), axis=0)))
    turns = 2 * moved / robot.rod.length / (2 * np.pi)
    if turns < _TURNS:
        return []
    says = f"the largest inputs would roll the arm up {turns:,.3g} times"
    advice = "the unit of its stiffness (N m2, Pa), of its size (m), or of the inputs"
    return [Finding("stiffness", "infeasible", says, advice)]


def start(case: Case) -> list[Finding]:
    """Can it be released from where the task begins?"""
    tip = case.study.task.start
    if tip is None:
        return []
    try:
        held = case.start
    except EquilibriumError as error:
        says = f"the task begins at {case.lengths(np.asarray(tip))}, but {error}"
        return [Finding("start", "infeasible", says, "a start nearer to rest, or larger input_bounds")]
    share = case.share(held.input)
    return [Finding("start", "ok", f"{percent(share)} of the input bound holds it where the task begins")]


def reach(case: Case) -> list[Finding]:
    """Can it be held at every point of the reference?"""
    missed, worst, around = float(case.misses.max()), int(case.misses.argmax()), _around(case)
    if missed <= CLOSE * case.size:
        return [Finding("reach", "ok", f"all of the reference can be held{around}")]
    says = (
        f"the reference at {case.lengths(case.places[worst])} is {case.length(missed)} away from the nearest pose that "
        f"the inputs can hold{around}"
    )
    advice = "a smaller reference, larger input_bounds, or cables farther from the axis of a softer or longer arm"
    rest = case.rest.output
    if np.linalg.norm(rest) > max(case.moved, CLOSE * case.size):  # how it is mounted moves it farther than its inputs
        advice = f"a reference about where it rests, {case.lengths(rest)}, or gravity along the arm"
    if case.asked > _ANOTHER_UNIT * case.moved > 0:
        times = f"{case.asked / case.moved:,.0f}"
        advice = f"is the reference in {case.units.output}? It asks for {times} times what the arm can do"
    return [Finding("reach", "doubtful" if case.holds else "infeasible", says, advice)]


def pulling(case: Case) -> list[Finding]:
    """Do the cables have to push?"""
    if case.pulling is None or case.study.mpc.outputs != 2 or len(case.corners(case.pulling)) < 3:
        return []
    least, most = _radii(case, case.pulling)
    upper = float(case.pulling[1].max())
    told = f"cables that only pull, with (0, {upper:g}) {case.units.input}, reach {case.span(least, most)}"
    if not case.holds:
        return [Finding("pulling", "ok", told)]
    if least >= float(np.linalg.norm(case.places - case.rest.output, axis=1).max()):
        return [Finding("pulling", "ok", f"{told}: they would do, too")]
    says = f"{told}: this task needs inputs that push, which a cable cannot unless it is pretensioned"
    return [Finding("pulling", "ok", says, "input_bounds from 0 on if yours only pull, and a smaller reference")]


def bounds(case: Case) -> list[Finding]:
    """Do the output bounds allow what is wanted?"""
    limits = case.study.mpc.output_limits
    if limits is None:
        return [Finding("output bounds", "ok", "there are none")]

    def room(points: np.ndarray) -> float:
        return float(np.minimum(points - limits[0], limits[1] - points).min())

    wanted, margin = room(case.reference[1:]), _NOISE_MARGIN * (case.noise or 0.0)
    if wanted < 0:
        says = f"the reference goes {case.length(-wanted)} beyond the output bounds"
        return [Finding("output bounds", "infeasible", says, "wider output_bounds, or a smaller reference")]
    for name, pose in (("rests", case.rest), ("begins", case.begun)):
        if (inside := room(pose.output)) < 0:
            says = f"the robot {name} at {case.lengths(pose.output)}, {case.length(-inside)} beyond the output bounds"
            advice = "output_bounds about where it is, or outputs counted from there"
            return [Finding("output bounds", "doubtful", says, advice)]
    says = f"the reference keeps {case.length(wanted)} away from them"
    if wanted < margin:
        says += f", {_NOISE_MARGIN:g} standard deviations of the noise are {case.length(margin)}"
        return [Finding("output bounds", "doubtful", says, "wider output_bounds: they will cost J at every sample")]
    return [Finding("output bounds", "ok", says)]


def holding(case: Case) -> list[Finding]:
    """What share of the input bound does it take to hold the reference?"""
    if not case.holds:
        return []  # said already: all of it is not enough
    says = f"holding the reference takes {percent(case.effort)} of the input bound at most"
    if case.effort <= _TIGHT:
        return [Finding("effort", "ok", says)]
    return [Finding("effort", "doubtful", f"{says}, which leaves little to steer with", "larger input_bounds")]


def gravity(case: Case) -> list[Finding]:
    """Does it stand up to its own weight and its loads?"""
    robot = case.of_a_rod
    if robot is None:
        return []
    rod, rest = robot.rod, case.rest.equilibrium
    assert rest is not None
    off = float(np.linalg.norm(rod.in_base_frame(rest.tip)[1:]))
    straight = off < _STRAIGHT * rod.length
    # Loads enter the tangent stiffness in proportion, as long as the rod stays straight.
    times = 1 / (1 - rest.stability) if rest.stability < 1 and straight else np.inf
    if rest.stability <= 0:
        stands = f": it stands up to {times:.2g} times that" if np.isfinite(times) else ""
        says = f"the arm buckles under its own weight and loads{stands}"
        return [Finding("gravity", "infeasible", says, "a stiffer, shorter or lighter arm, or one that hangs")]
    if not any(rod.gravity) and not rod.payloads and not rod.loads:
        says = f"neither weight nor loads in this model of {robot.mass:.2g} kg"
        return [Finding("gravity", "ok", says, "gravity of the rod, if the real one hangs or stands")]
    told = "at rest it is straight" if straight else f"at rest its tip is {1e3 * off:.3g} mm off the axis"
    if times < _WEIGHT_MARGIN:
        says = f"{told}; it buckles at {times:.2f} times its weight and loads"
        return [Finding("gravity", "doubtful", says, "a payload or a softer day may tip it: stiffer, shorter, lighter")]
    buckles = f"; it buckles at {times:.3g} times its weight and loads" if times < 1e3 else ""
    return [Finding("gravity", "ok", f"{told}{buckles}")]


def _around(case: Case) -> str:
    """How far it reaches, to be added to a sentence."""
    p = case.study.mpc.outputs
    if p == 2 and len(case.corners(case.bounds)) > 2:
        return f"; the robot reaches {case.span(*_radii(case, case.bounds))} around rest"
    ends = [
        farthest(case.robot, sign * axis, case.bounds, case.rest).output[i]
        for i, axis in enumerate(np.eye(p))
        for sign in (-1, 1)
    ]
    told = [case.span(low, high) for low, high in zip(ends[::2], ends[1::2], strict=True)]
    return f"; its outputs reach {', '.join(told)}"


def _radii(case: Case, inputs: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    corners, angles = case.corners(inputs), np.linspace(0, 2 * np.pi, 72, endpoint=False)
    radii = [ray(corners, case.rest.output, np.array([np.cos(a), np.sin(a)])) for a in angles]
    return min(radii), max(radii)
