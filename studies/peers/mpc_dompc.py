"""do-mpc: the problem as its users write it, solved by IPOPT in every step.

Its own soft constraints have a linear weight; the quadratic one is written as one more input for each output.
"""

import warnings
from collections.abc import Callable

import numpy as np

from .mpc_case import Case


def dompc_python(case: Case) -> Callable[[np.ndarray], np.ndarray]:
    """`do_mpc.controller.MPC.make_step`, from the solution before."""
    import casadi as ca

    with warnings.catch_warnings(action="ignore"):  # of its parts that want other packages
        import do_mpc  # pyright: ignore[reportMissingImports]

    N, n, m, outputs = case.horizon, case.states, case.inputs, case.outputs
    C, Q, R = case.C / case.ymax, case.Q * case.ymax**2, case.R * case.umax**2
    cost = 1 / R
    model = do_mpc.model.Model("discrete", "MX")
    x, u = model.set_variable("_x", "x", (n, 1)), model.set_variable("_u", "u", (m, 1))
    model.set_variable("_tvp", "r", (outputs, 1))
    if case.soft:
        model.set_variable("_u", "s", (outputs, 1))
    model.set_rhs("x", ca.DM(case.A) @ x + ca.DM(case.umax * case.B) @ u)
    model.setup()
    x, u, r = model.x["x"], model.u["u"], model.tvp["r"]
    s = model.u["s"] if case.soft else ca.DM.zeros(outputs)
    error, next_output = ca.DM(C) @ x - r, ca.DM(C @ case.A) @ x + ca.DM(case.umax * C @ case.B) @ u
    mpc = do_mpc.controller.MPC(model)
    tolerances = {"ipopt.tol": 1e-10, "ipopt.acceptable_tol": 1e-10, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    constant = {name: "yes" for name in ("hessian_constant", "jac_c_constant", "jac_d_constant")}
    mpc.settings.n_horizon, mpc.settings.t_step = N, 1.0
    mpc.settings.store_full_solution = False
    mpc.settings.store_lagr_multiplier = False
    mpc.settings.nlpsol_opts = {"print_time": False, **tolerances, **{f"ipopt.{k}": v for k, v in constant.items()}}
    stage = (Q * ca.sumsqr(error) + R * ca.sumsqr(u) + case.rho * case.ymax**2 * ca.sumsqr(s)) / 2
    mpc.set_objective(mterm=cost * Q * ca.sumsqr(error) / 2, lterm=cost * stage)
    mpc.set_rterm(u=0.0)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -np.ones(m), np.ones(m)
    if case.soft:
        mpc.set_nl_cons("upper", next_output + s, ub=1)
        mpc.set_nl_cons("lower", -next_output - s, ub=1)
    template = mpc.get_tvp_template()
    wanted = np.zeros(outputs)

    def references(_: float) -> object:
        for k in range(N + 1):
            template["_tvp", k, "r"] = wanted
        return template

    mpc.set_tvp_fun(references)
    mpc.setup()
    mpc.x0 = case.p[0, :n]
    mpc.set_initial_guess()

    def solve(p: np.ndarray) -> np.ndarray:
        wanted[:] = p[n:] / case.ymax
        mpc.make_step(p[:n].reshape(-1, 1))
        moves = mpc.opt_x_num["_u", :, 0, "u"]
        return np.concatenate([np.array(move).ravel() for move in moves])

    return solve
