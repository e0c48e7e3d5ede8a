"""The step couple by other people's rods, each as fast as it can be made to go: ``pip install socasadi[peers]``.

One core: every run has a process of its own, bound to one processor; Exudyn and JAX are told one thread, and
PyElastica's loops are serial.
"""

from .case import Absent, Run, measured
from .exudyn import exudyn
from .pyelastica import pyelastica
from .soromox import soromox

__all__ = ["Absent", "Run", "exudyn", "measured", "pyelastica", "soromox"]
