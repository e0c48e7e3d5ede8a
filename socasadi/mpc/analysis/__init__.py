"""What linear theory says of a controller, and what it cannot say."""

from ._analysis import Analysis, Poles, analyse
from ._peak import Peak

__all__ = [
    "Analysis",
    "Peak",
    "Poles",
    "analyse",
]
