from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as ca

if TYPE_CHECKING:
    from .._rod import Rod


class Parameters:
    """What becomes of a rod's symbolic parameters in its equations.

    Attributes
    ----------
    symbols
        Column of the symbols that the rod was written with.
    free
        The last argument of every Function, (p,); empty for a rod of numbers.
    values
        What stands for the symbols: that argument, or nothing.
    """

    def __init__(self, rod: Rod) -> None:
        self.symbols = ca.vertcat(ca.SX(0, 1), *rod.parameters)
        self.free = (ca.MX.sym("p", self.symbols.numel()),) if rod.parameters else ()
        self.values: ca.MX | ca.DM = self.free[0] if self.free else ca.DM(0, 1)

    def lift(self, value: Any) -> Any:
        """A number or an array of numbers as DM; an expression of the symbols as one of the argument p, MX."""
        value = ca.SX(value)
        if not ca.symvar(value):
            return ca.evalf(value)
        return ca.Function("numbers", [self.symbols], [value])(self.values)

    def function(
        self, name: str, inputs: list[ca.MX], outputs: list[ca.MX], names_in: list[str], names_out: list[str]
    ) -> ca.Function:
        """A Function of ``inputs`` and of the free parameters."""
        return ca.Function(name, [*inputs, *self.free], outputs, names_in + ["p"] * len(self.free), names_out)
