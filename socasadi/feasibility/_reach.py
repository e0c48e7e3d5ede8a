"""Where a robot can be held at rest: the nearest pose to a wanted output, and how far it reaches in each direction."""

from contextlib import suppress

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial import ConvexHull, QhullError

from ..rod import EquilibriumError
from ._robot import Pose, Robot

Bounds = tuple[np.ndarray, np.ndarray]

_STEPS = 12
_LEAST_NORM = 1e-4  # what a unit of input costs beside a miss as large as the robot's reach, both squared
_CLIMBS, _HALVINGS = 4, 10


def nearest(robot: Robot, wanted: np.ndarray, bounds: Bounds, start: Pose, calm: np.ndarray | None = None) -> Pose:
    """The pose within the bounds whose output is nearest to ``wanted`` (p,), and of these about nearest to ``calm``.

    Gauss-Newton from ``start``: in each step a bounded least-squares problem on the linearised outputs. ``calm`` (m,)
    are inputs, those that do nothing by default.
    """
    calm = robot.neutral if calm is None else calm
    pose, scale = start, np.maximum(*np.abs(bounds))
    scale = np.where(scale > 0, scale, 1.0)
    for _ in range(_STEPS):
        slope = pose.slope * scale
        size = max(float(np.abs(slope).sum(axis=1).max()), 1e-12)
        goal = (wanted - pose.output + pose.slope @ pose.input) / size
        rows = np.vstack([slope / size, _LEAST_NORM * np.eye(len(scale))])
        lower, upper = (side / scale for side in bounds)
        free = lower < upper  # the solver wants its bounds apart
        answer = lower.copy()
        rest = np.concatenate([goal, _LEAST_NORM * calm / scale]) - rows[:, ~free] @ lower[~free]
        if free.any():
            answer[free] = lsq_linear(rows[:, free], rest, (lower[free], upper[free])).x
        moved = _towards(robot, pose, np.clip(answer * scale, *bounds))
        change = float(np.abs((moved.input - pose.input) / scale).max())
        pose = moved
        if change < 1e-4:
            break
    return pose


def farthest(robot: Robot, direction: np.ndarray, bounds: Bounds, start: Pose) -> Pose:
    """The pose within the bounds whose output lies farthest along ``direction`` (p,).

    Each input goes to the bound to which the slope points, again from the pose that this gives.
    """
    best = pose = start
    for _ in range(_CLIMBS):
        given = np.where(direction @ pose.slope > 0, bounds[1], bounds[0])
        if np.array_equal(given, pose.input):
            break
        pose = _towards(robot, pose, given)
        if direction @ pose.output > direction @ best.output:
            best = pose
    return best


def reachable(robot: Robot, bounds: Bounds, rest: Pose, directions: int = 36) -> np.ndarray:
    """Corners (k, 2), in order, of the convex hull of two outputs at rest within the bounds."""
    angles = 2 * np.pi * np.arange(directions) / directions
    corners, pose = [], rest
    for angle in angles:
        pose = farthest(robot, np.array([np.cos(angle), np.sin(angle)]), bounds, pose)
        corners.append(pose.output)
    points = np.array(corners)
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on a line, or one point
        along = points - points.mean(axis=0)
        order = np.argsort(along @ np.linalg.svd(along)[2][0])
        return points[order[[0, -1]]]


def ray(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """How far a convex polygon (k, 2) reaches from a point along a unit direction; 0 where the ray misses it."""
    reach = 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        matrix = np.column_stack([direction, start - end])
        if abs(np.linalg.det(matrix)) < 1e-300:
            continue
        along, share = np.linalg.solve(matrix, start - origin)
        if -1e-9 <= share <= 1 + 1e-9:
            reach = max(reach, float(along))
    return reach


def _towards(robot: Robot, pose: Pose, given: np.ndarray) -> Pose:
    """The pose under ``given``, or as far on the way there as the robot comes to rest."""
    for halvings in range(_HALVINGS):
        with suppress(EquilibriumError):
            found = robot.pose(pose.input + 0.5**halvings * (given - pose.input), pose)
            if np.isfinite(found.output).all():
                return found
    return pose
