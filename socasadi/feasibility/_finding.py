from dataclasses import dataclass
from typing import Literal

import numpy as np

Verdict = Literal["ok", "unknown", "doubtful", "infeasible"]
"""From good to bad."""
VERDICTS: tuple[Verdict, ...] = ("ok", "unknown", "doubtful", "infeasible")


@dataclass(frozen=True)
class Finding:
    """One line of a check.

    Attributes
    ----------
    name
        What was looked at.
    verdict
        ``"ok"``, ``"doubtful"``, ``"infeasible"``; ``"unknown"`` where too little is known of the robot.
    says
        What was found, with its number.
    advice
        What to change, empty where nothing has to be.
    """

    name: str
    verdict: Verdict
    says: str
    advice: str = ""


@dataclass(frozen=True, eq=False)
class Picture:
    """What can be drawn of a check in the plane of two outputs.

    Attributes
    ----------
    shown
        A factor on all of these, and the unit in which they are drawn then.
    reach, pulling
        Corners (k, 2) of the convex hull of where the robot can be held: with the study's inputs, and with cables that
        only pull where the study lets them push.
    rest, start
        (2,) outputs without inputs, and those from which the robot is released.
    reference
        (T + 1, 2).
    bounds
        Lower and upper output bounds, (2,) each; None without.
    """

    shown: tuple[float, str]
    reach: np.ndarray
    pulling: np.ndarray | None
    rest: np.ndarray
    start: np.ndarray
    reference: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True, eq=False)
class Check:
    """What was found, before any experiment.

    Attributes
    ----------
    source
        Where the knowledge of the robot comes from.
    findings
        In the order in which they were looked at.
    picture
        None unless there are two outputs and something is known of the robot.
    """

    source: str
    findings: tuple[Finding, ...]
    picture: Picture | None = None

    @property
    def verdict(self) -> Verdict:
        """The worst of the findings."""
        return VERDICTS[max((VERDICTS.index(finding.verdict) for finding in self.findings), default=0)]

    @property
    def objections(self) -> tuple[Finding, ...]:
        """The findings that are doubtful or infeasible, the worst first."""
        against = [finding for finding in self.findings if finding.verdict in ("doubtful", "infeasible")]
        return tuple(sorted(against, key=lambda finding: -VERDICTS.index(finding.verdict)))
