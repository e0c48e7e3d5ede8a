"""The step couple by other people's rods, each as fast as it can be made to go: ``pip install socasadi[peers]``.

One core: every run has a process of its own, bound to one processor; Exudyn and JAX are told one thread, and
PyElastica's loops are serial.
"""

from ._exudyn import exudyn
from ._pyelastica import pyelastica
from ._soromox import soromox
from .case import Absent, Run, measured

__all__ = ["Absent", "Run", "exudyn", "measured", "pyelastica", "soromox"]
