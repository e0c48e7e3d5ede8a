from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Record:
    """What one experiment gave: the tensions that were held and the outputs that were measured.

    Parameters
    ----------
    sample_time
        s.
    tension
        (N, m) N; row t was held during sample t.
    output
        (N + 1, p) m; row 0 was measured before the first sample, row t + 1 at the end of sample t.

    Raises
    ------
    ValueError
        The shapes do not fit each other, a value is not finite, or the record is empty.
    """

    sample_time: float
    tension: np.ndarray
    output: np.ndarray

    def __post_init__(self) -> None:
        for name in ("tension", "output"):
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 2 or not values.size:
                raise ValueError(f"{name} of a record is a table with a row a sample, not of shape {values.shape}")
            if not np.isfinite(values).all():
                row = int(np.argwhere(~np.isfinite(values))[0, 0])
                raise ValueError(f"{name} of a record must be finite, but row {row} is {values[row]}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if len(self.output) != len(self.tension) + 1:
            raise ValueError(
                f"a record of {len(self.tension)} samples has {len(self.tension) + 1} rows of outputs "
                f"(one before the first sample), not {len(self.output)}"
            )
        if not (np.isfinite(self.sample_time) and self.sample_time > 0):
            raise ValueError(f"sample_time of a record must be positive, not {self.sample_time} s")
