"""SoRoMoX: strain-parametrised like this package, in JAX."""

import os
import time
from importlib.metadata import version
from typing import Any

import numpy as np

from .case import COUPLE, DENSITY, DURATION, LENGTH, RADIUS, TIMES, VISCOSITY, YOUNG, Run


def soromox(
    orders: tuple[int, ...] = (-1, 2, 2, -1, -1, -1),
    solver: str = "SemiImplicitEuler",
    step: float = 2.5e-3,
    rtol: float | None = None,
) -> Run:
    """GVS, Legendre `orders` of kx, ky, kz, sx, sy, sz (-1: none); its own solver or Diffrax's; adaptive by `rtol`."""
    os.environ["JAX_PLATFORMS"], os.environ["JAX_ENABLE_X64"] = "cpu", "1"
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    import diffrax  # pyright: ignore[reportMissingImports]
    import equinox  # pyright: ignore[reportMissingImports]
    import jax.numpy as jnp  # pyright: ignore[reportMissingImports]
    from soromox.simulation.integrators import SemiImplicitEuler  # pyright: ignore[reportMissingImports]
    from soromox.systems.components import JointSpec, LinkSpec  # pyright: ignore[reportMissingImports]
    from soromox.systems.gvs import GVS, GVSSegment, StrainBasisSpec  # pyright: ignore[reportMissingImports]
    from soromox.systems.system_state import SystemState  # pyright: ignore[reportMissingImports]

    begin = time.perf_counter()
    shape = {"length": LENGTH, "radius": RADIUS, "reference_strain": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]}
    material = {"density": DENSITY, "young_modulus": YOUNG, "shear_modulus": YOUNG / 3}
    link = LinkSpec.circular(**shape, **material, material_damping_coefficient=VISCOSITY)
    present = [int(order >= 0) for order in orders]
    basis = StrainBasisSpec("legendre", present, [max(order, 0) for order in orders])
    segment = GVSSegment(link, JointSpec.fixed(), basis, num_gauss_points=max(5, max(orders) + 3))
    rod = GVS.from_segments([segment], gravity=jnp.zeros(3), base_pose=jnp.array([0, 0, 0, 1.0, 0, 0, 0]))
    dof = sum(order + 1 for order in orders)
    # A couple about z does work on the rotation of the tip in the plane alone: its generalised force is constant.
    end = jnp.array(LENGTH)
    force = rod.jacobian_inertialframe(jnp.zeros(dof), end).T @ jnp.array([0, 0, COUPLE, 0, 0, 0])
    method = SemiImplicitEuler(rod) if solver == "SemiImplicitEuler" else getattr(diffrax, solver)()
    control = diffrax.ConstantStepSize() if rtol is None else diffrax.PIDController(rtol=rtol, atol=rtol / 10)

    @equinox.filter_jit
    def simulate(state: Any, force: Any) -> Any:
        initial = SystemState(t=0.0, y=state)
        options = {"solver": method, "stepsize_controller": control, "solver_dt": step}
        return rod.rollout_to(initial, tau_ext=force, t1=DURATION, save_ts=jnp.array(TIMES), **options).y

    rest = jnp.zeros(2 * dof)
    states = simulate(rest, force).block_until_ready()
    setup, walls = time.perf_counter() - begin, []
    for _ in range(3):
        begin = time.perf_counter()
        states = simulate(rest, force).block_until_ready()
        walls.append(time.perf_counter() - begin)
    tip = np.array([rod.forward_kinematics(state[:dof], end)[:3, 3] for state in states])
    name = f"SoRoMoX {version('soromox')}, {solver}, orders {orders}, "
    name += f"{1e3 * step:.3g} ms" if rtol is None else f"rtol {rtol:g}"
    return Run(name, True, dof, TIMES, tip, min(walls), setup - min(walls))
