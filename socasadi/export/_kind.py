import re
from dataclasses import dataclass

from ..mpc import check_real
from ._errors import ExportError

SOLVERS = ("active-set", "osqp")
"""QP solvers of an exported controller."""

_TAKEN = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
bool catch class delete explicit export false friend mutable namespace new operator private protected public template
this throw true try typename using virtual
mpc qp real self data vectors replay example u y r w main malloc free printf memset memcpy
"""
"""Names that mean something in C, in C++ or in the exported files."""


@dataclass(frozen=True)
class Kind:
    """How a controller is written out."""

    real: str
    solver: str
    name: str

    def __post_init__(self) -> None:
        try:
            check_real(self.real)
        except ValueError as error:
            raise ExportError(str(error)) from None
        if self.solver not in SOLVERS:
            raise ExportError(f"unknown solver {self.solver!r}; there are {', '.join(SOLVERS)}")
        if not re.fullmatch(r"(?!mpc_|qp_|real_)[a-z][a-z0-9_]*", self.name) or self.name in _TAKEN.split():
            raise ExportError(
                f"the name {self.name!r} does not do for C: small letters, digits and _, no word of the language and "
                "none that the export's own files use, such as mpc or data"
            )
