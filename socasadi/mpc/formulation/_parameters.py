from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Parameters:
    """Layout of what the QP depends on from sample to sample: p = (x, v before, reference, w, 1).

    x is the observer's state, v the scaled input before, the reference row after row, w what is measured of the
    disturbances. Everything online is affine in them: a matrix with ``size`` columns.
    """

    state: int
    inputs: int
    reference: int
    disturbances: int

    @property
    def widths(self) -> dict[str, int]:
        return {"x": self.state, "v": self.inputs, "r": self.reference, "w": self.disturbances, "one": 1}

    @property
    def size(self) -> int:
        return sum(self.widths.values())

    def map(self, rows: int, **blocks: ca.MX | ca.DM) -> ca.MX:
        """The (rows, size) map that has these blocks, by their names in ``widths``, and zeros elsewhere."""
        return ca.horzcat(*[blocks.get(name, ca.MX(rows, width)) for name, width in self.widths.items()])

    def known(self, free: ca.MX) -> dict[str, ca.MX]:
        """The blocks of a map of (x, w), which is what a prediction starts from."""
        x, w = ca.horzsplit(free, [0, self.state, self.state + self.disturbances])
        return {"x": x, "w": w}
