import numpy as np

from ...model import Record
from ...plant import Plant
from ._episode import measured


def probe(
    plant: Plant,
    input_bounds: tuple,
    *,
    duration: float = 20.0,
    hold: float = 0.5,
    share: float = 0.5,
    seed: int = 0,
) -> Record:
    """One short open-loop experiment: random steps of all tensions, from rest.

    Parameters
    ----------
    input_bounds
        (lower, upper) of the tensions, N; numbers or one per tension.
    duration
        s.
    hold
        How long each step lasts, s; about a quarter of the slowest period shakes all modes of interest.
    share
        Of the range of the bounds, about its middle, that the steps use.
    seed
        Of the steps and of the sensor.

    Raises
    ------
    ValueError
        A number is out of its range.
    """
    if not 0 < share <= 1:
        raise ValueError(f"share of the input range lies above 0 and at most at 1, not at {share}")
    if not duration >= hold >= plant.sample_time:
        raise ValueError(f"a step is held for {plant.sample_time} s to {duration} s, not for {hold} s")
    lower, upper = (np.broadcast_to(np.asarray(side, dtype=float), (plant.inputs,)) for side in input_bounds)
    samples, held = round(duration / plant.sample_time), round(hold / plant.sample_time)
    steps = np.random.default_rng(seed).uniform(-share, share, (-(-samples // held), plant.inputs))
    tension = np.repeat((lower + upper) / 2 + steps * (upper - lower) / 2, held, axis=0)[:samples]
    output = [measured(plant, plant.reset(seed=seed, tension_bounds=input_bounds))]
    output += [measured(plant, plant.step(row)) for row in tension]
    return Record(plant.sample_time, tension, np.array(output))
