"""Random numbers of a study's experiments: each has its own, whatever was flown before."""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What an experiment is for."""

    TRIAL = 0
    VERIFICATION = 1
    PROBE = 2


def drawn_seed(seed: int, stream: Stream, number: int) -> int:
    """The seed of one experiment, of a study's own and the experiment's number in its stream."""
    return int(np.random.SeedSequence([seed, stream, number]).generate_state(1)[0])
