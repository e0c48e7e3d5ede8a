"""What is put beside a model's own states: inputs that are on their way, and disturbances."""

from typing import NamedTuple

import casadi as ca


class System(NamedTuple):
    """x+ = A x + B v + E w, y+ = C x+ + D v + F w, with inputs v and measured disturbances w."""

    A: ca.MX
    B: ca.MX
    E: ca.MX
    C: ca.MX
    D: ca.MX
    F: ca.MX


def queued(system: System, delay: int) -> System:
    r"""The system with the last inputs among its states, newest first, where v acts ``delay`` samples late.

    The queue is :math:`(v_{t-1}, ..., v_{t-1-delay})`. Its last entry has acted already: it is there because y depends
    on it through D, which therefore is zero here.
    """
    n, m = system.B.shape
    p, length = system.C.shape[0], (delay + 1) * m

    def acting(matrix: ca.MX, place: int) -> ca.MX:
        rows = matrix.shape[0]
        return ca.horzcat(ca.MX(rows, place * m), matrix, ca.MX(rows, length - (place + 1) * m))

    onwards = ca.vertcat(ca.MX(m, length), ca.horzcat(ca.MX.eye(length - m), ca.MX(length - m, m)))
    newest = ca.vertcat(ca.MX.eye(m), ca.MX(length - m, m))
    undelayed = delay == 0
    return System(
        A=ca.vertcat(
            ca.horzcat(system.A, ca.MX(n, length) if undelayed else acting(system.B, delay - 1)),
            ca.horzcat(ca.MX(length, n), onwards),
        ),
        B=ca.vertcat(system.B if undelayed else ca.MX(n, m), newest),
        E=ca.vertcat(system.E, ca.MX(length, system.E.shape[1])),
        C=ca.horzcat(system.C, acting(system.D, delay)),
        D=ca.MX(p, m),
        F=system.F,
    )


def disturbed(system: System, on_state: ca.MX, on_output: ca.MX) -> System:
    """The system with constant disturbances d behind its states: x+ gets ``on_state @ d``, y ``on_output @ d``.

    ``on_state`` has the rows of the model's own states; states behind them are not disturbed.
    """
    p = on_output.shape[1]
    order = system.A.shape[0]
    reached = ca.vertcat(on_state, ca.MX(order - on_state.shape[0], p))
    return System(
        A=ca.vertcat(ca.horzcat(system.A, reached), ca.horzcat(ca.MX(p, order), ca.MX.eye(p))),
        B=ca.vertcat(system.B, ca.MX(p, system.B.shape[1])),
        E=ca.vertcat(system.E, ca.MX(p, system.E.shape[1])),
        C=ca.horzcat(system.C, on_output),
        D=system.D,
        F=system.F,
    )
