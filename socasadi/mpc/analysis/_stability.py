"""What is established of a controller's stability, and what is not, in words."""

from typing import TYPE_CHECKING

from ._loop import decays

if TYPE_CHECKING:
    from .._spec import LinearMPC

_BOOK = "Rawlings, Mayne, Diehl, Model Predictive Control, 2nd ed., chapter 2"


def established(
    mpc: "LinearMPC", *, nominal_radius: float, loop_radius: float, open_radius: float, on_model: bool
) -> tuple[str, ...]:
    """What holds, one sentence each.

    That plans which end inside a terminal set come true holds although the set is not imposed, by three facts: the
    Riccati cost is no more than any cost to go within bounds, equal to it where the law beyond keeps all bounds; a
    longer horizon therefore never costs less; and the rest of an optimal plan is optimal.

    Parameters
    ----------
    nominal_radius, loop_radius
        Spectral radius of the loop without active bounds on the prediction model and on the plant in question.
    open_radius
        Spectral radius of the plant itself.
    """
    verdict = _verdict(nominal_radius)
    if _without_end(mpc):
        verdict += "; the law is the linear-quadratic one of the problem without end (Riccati), whatever the horizon"
    told = [f"While no bound is active the loop on the prediction model is {verdict}."]
    if not on_model:
        told.append(f"While no bound is active the loop on the plant given is {_verdict(loop_radius)}.")
    told.append("Every sample's QP has a solution: the input before keeps all hard bounds, and output bounds are soft.")
    if decays(open_radius):
        told.append(
            f"Bounds active or not: inputs are bounded and the {'model' if on_model else 'plant given'} is stable by "
            f"itself (spectral radius {open_radius:.4f}), so that under bounded disturbances everything stays bounded."
        )
    if _without_end(mpc) and decays(nominal_radius):
        told.append(
            "On the model, its state known and the reference constant, a plan that ends where the unconstrained law "
            "keeps all bounds for good comes true, and the loop settles (Scokaert and Rawlings, IEEE TAC 43, 1998)."
        )
    return tuple(told)


def not_established(
    mpc: "LinearMPC", *, loop_radius: float, open_radius: float, robust_error: float
) -> tuple[str, ...]:
    """What does not follow, one sentence each; arguments as above and the error that the small-gain theorem allows."""
    left = []
    if mpc.terminal is None:
        left.append(
            "Convergence with active bounds: with neither terminal cost nor terminal set nothing is stable by design "
            f"({_BOOK}); without active bounds, too, the poles are the only evidence."
        )
    else:
        left.append(
            "Convergence with active bounds from any state: there is no terminal set, and where the unconstrained law "
            "would break a bound beyond the horizon the Riccati cost is too low to be a Lyapunov function; for a "
            f"stable model with input bounds alone, the cost of an input at rest would be one ({_BOOK})."
        )
    if not decays(open_radius):
        left.append(
            f"Anything global: the plant is not stable by itself (spectral radius {open_radius:.4f}), and from far "
            "enough no input inside the bounds brings it back."
        )
    if set(mpc.blocks) != {1}:
        left.append(
            f"Stability by design with {len(mpc.blocks)} moves over {mpc.horizon} samples: a sample later the rest of "
            "the last plan does not fit the blocks, so that the usual proof fails; the poles are the evidence."
        )
    left.append(
        "Convergence to a reference that no input inside the bounds holds, or that is outside the output bounds."
    )
    robot = "Stability on the robot itself, which is not linear"
    if decays(loop_radius):
        robot += (
            ": while no bound is active the loop bears any stable error of the outputs, linear or not, of a gain below "
            f"{100 * robust_error:.3g} % (small-gain theorem)"
        )
    left.append(f"{robot}.")
    return tuple(left)


def _verdict(radius: float) -> str:
    return f"{'stable' if decays(radius) else 'UNSTABLE'}, spectral radius {radius:.4f}"


def _without_end(mpc: "LinearMPC") -> bool:
    return mpc.terminal == "riccati" and set(mpc.blocks) == {1}
