"""What linear theory says of a controller, and what it cannot say."""

from ._analysis import Analysis, Poles, analyse
from ._peak import Peak
from ._radius import loop_radius

__all__ = [
    "Analysis",
    "Peak",
    "Poles",
    "analyse",
    "loop_radius",
]
