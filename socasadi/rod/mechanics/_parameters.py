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
        The last argument of every Function, (p,); empty where there are no parameters or all have values.
    values
        What stands for the symbols: numbers, or that argument.
    """

    def __init__(self, rod: Rod) -> None:
        self.symbols = ca.vertcat(ca.SX(0, 1), *rod.parameters)
        given = rod.parameter_values
        self.free: tuple[ca.MX, ...] = ()
        self.values: Any = ca.DM(0, 1) if given is None else ca.DM(given)
        if rod.parameters and given is None:
            self.free = (ca.MX.sym("p", self.symbols.numel()),)
            self.values = self.free[0]

    def lift(self, value: Any) -> Any:
        """A number or an array of numbers as DM; an expression of the symbols as what their values make of it."""
        value = ca.SX(value)
        if not ca.symvar(value):
            return ca.evalf(value)
        return ca.Function("numbers", [self.symbols], [value])(self.values)

    def function(
        self, name: str, inputs: list[ca.MX], outputs: list[ca.MX], names_in: list[str], names_out: list[str]
    ) -> ca.Function:
        """A Function of ``inputs`` and of the free parameters."""
        return ca.Function(name, [*inputs, *self.free], outputs, names_in + ["p"] * len(self.free), names_out)
