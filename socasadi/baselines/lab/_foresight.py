import numpy as np

from ...model import Entry

FORESIGHT = (Entry("lead", "samples", 0.5, 20.5, "log"), Entry("smoothing", "s", 0.005, 2.0, "log"))
"""What of a :class:`Foresight` can be tuned."""


class Foresight:
    """The reference that a law without a forecast feeds forward: some samples ahead, and smoothed.

    Parameters
    ----------
    time
        s, of a sample.
    lead
        Samples that it looks ahead of the coming one, as far as the reference is seen; rounded.
    smoothing
        s, time constant of the first-order filter behind.
    """

    def __init__(self, time: float, lead: float, smoothing: float) -> None:
        self._lead, self._share = round(lead), time / (time + smoothing)
        self.begin()

    def begin(self) -> None:
        """Start anew, from where the outputs are at the first sample."""
        self._smooth: np.ndarray | None = None

    def ahead(self, y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """What is fed forward now (p,); y (p,) and reference (P, p), all m."""
        before = y if self._smooth is None else self._smooth
        self._smooth = now = before + self._share * (reference[min(self._lead, len(reference) - 1)] - before)
        return now
