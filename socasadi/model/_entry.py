import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Entry:
    """One number of theta: its name, its unit and the interval in which it is searched.

    Parameters
    ----------
    name, unit
        What it is and in which SI unit it is given.
    lower, upper
        Bounds of the search, in that unit.
    scale
        ``"log"`` when only its order of magnitude is known (both bounds positive), else ``"linear"``.

    Raises
    ------
    ValueError
        The bounds are not finite, do not ascend, or are not positive on a log scale.
    """

    name: str
    unit: str
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "linear"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            raise ValueError(f"bounds of {self.name} must be finite, not ({self.lower}, {self.upper})")
        if self.lower >= self.upper:
            raise ValueError(
                f"bounds of {self.name} must ascend: lower {self.lower:g} is not below upper {self.upper:g} {self.unit}"
            )
        if self.scale not in ("linear", "log"):
            raise ValueError(f"scale of {self.name} is 'linear' or 'log', not {self.scale!r}")
        if self.scale == "log" and self.lower <= 0:
            raise ValueError(f"bounds of {self.name} must be positive on a log scale, not lower = {self.lower:g}")
