"""How the rod's answers converge: with the time step, the strain basis and the quadrature points.

    python studies/rod_convergence.py

What came out, for rods of 0.6 m with large deflections:

- Time step: the W-method is of order two (slope 1.99), and errs by 0.43 um at substeps of 4 ms. CasADi's collocation
  agrees with CVODES to 5 nm at 60 ms.
- Strain basis, under a force that pushes the tip aside by 81 % of the length: piecewise constant curvature converges
  with order 2 (6 coordinates: 3.3 mm, 48: 50 um), hat functions with order 4 (6: 20 um). Legendre polynomials
  converge faster than any order (4: 11 um, 6: 1 um, 8: 2 nm); cubic B-splines come near them.
- Quadrature, under the rod's own weight: order 4 in the number of points (slope -4.06), because the rod is integrated
  from point to point by a method of order 4; then the basis limits. With the default points (6, or twice the order
  plus 2) the two together err by 3.6 um at order 3, 7.5 at 4, 1.4 at 6 and 0.6 at 8.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from socasadi import Rod
from socasadi.rod import BSpline, Legendre, Material, Section, Strain

LENGTH, RUBBER, SECTION = 0.6, Material(young=1e6, poisson=0.5, density=1000.0), Section.circle(0.03)
EI = 1e6 * np.pi * 0.03**4 / 4
FORCE = (0.0, 10 * EI / LENGTH**2, 0.0)  # at the tip, N: pushes it aside by 81 % of the length
GRAVITY = (0.0, 10 * EI / LENGTH**3 / (1000 * np.pi * 0.03**2), 0.0)  # m/s^2: pulls it aside by 70 %
COLOURS, MARKS = ("#0072B2", "#D55E00", "#009E73", "#000000"), "osv^"


def main() -> None:
    plt.rc("font", size=8)
    plt.rc("axes", titlesize=8)
    plt.rc("axes.spines", top=False, right=False)
    plt.rc("legend", fontsize=7, frameon=False)
    plt.rc("lines", markersize=3.5)
    figure, panels = plt.subplots(1, 3, figsize=(7.1, 3.1), layout="constrained")
    for axes, study in zip(panels, (time_step, basis, quadrature), strict=True):
        print(study.__doc__)
        study(axes)
        axes.minorticks_off()
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
    figure.savefig(Path(__file__).parent / "figures" / "rod-convergence.png", dpi=300)


def time_step(axes: Axes) -> None:
    """Time step: preset "paper" half a second after 5 N are put on one cable, against CVODES."""
    rod, duration = Rod.preset("paper"), 0.5

    def tip(sample: ca.Function) -> np.ndarray:
        return rod.tip(sample(np.zeros(2 * rod.dof), [5.0, 0.0, 0.0], np.zeros(3))[: rod.dof]).full()[:, 0]

    exact = tip(rod.reference_step(duration, "cvodes"))
    steps = [duration / n for n in (8, 16, 32, 64, 128, 256, 512, 1024)]
    draw(axes, 0, "W-method", steps, [tip(rod.step(duration, substep=h)) - exact for h in steps], order=2)
    ends = [tip(rod.reference_step(duration, "collocation", elements=n)) for n in (8, 16, 32)]
    draw(axes, 1, "collocation of degree 4", steps[:3], [end - exact for end in ends])
    axes.set(title="after a step of tension", xlabel="time step / s", ylabel="error of the tip / m")


def basis(axes: Axes) -> None:
    """Strain basis: a force at the tip of an inextensible cantilever, against the elastica."""
    exact = elastica(lambda s, angle: -10 * np.cos(angle))

    def compare(i: int, name: str, sizes: Sequence[int], degree: int | None, order: int | None = None) -> None:
        errors = []
        for n in sizes:
            bending, pieces = (Legendre(n - 1), 1) if degree is None else (BSpline(degree, n - degree), n - degree)
            points = 240 // pieces  # in each: so many that the basis alone errs
            rod = Rod(LENGTH, SECTION, RUBBER, Strain(bending_z=bending), quadrature_points=points)
            errors.append(rod.equilibrium(tip_force=FORCE).tip[:2] - exact)
        draw(axes, i, name, sizes, errors, order)

    sizes = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
    compare(0, "PCS", sizes, 0, order=-2)
    compare(1, "hat functions", sizes, 1, order=-4)
    compare(2, "cubic B-splines", sizes[2:7], 3)
    compare(3, "Legendre polynomials", sizes[:6], None)
    axes.set(title="force at the tip", xlabel="coordinates")
    axes.set_xticks(sizes[::2], map(str, sizes[::2]))


def quadrature(axes: Axes) -> None:
    """Quadrature: a heavy inextensible cantilever, Legendre polynomials, against the elastica under its weight."""
    exact = elastica(lambda s, angle: -10 * (1 - s) * np.cos(angle))
    counts = (3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
    for i, order in enumerate((2, 4, 6, 8)):
        enough, errors = [n for n in counts if n > order], []
        for n in enough:
            rod = Rod(LENGTH, SECTION, RUBBER, Strain(bending_z=order), gravity=GRAVITY, quadrature_points=n)
            errors.append(rod.equilibrium().tip[:2] - exact)
        draw(axes, i, f"Legendre order {order}", enough, errors, -4 if order == 8 else None)
    axes.set(title="own weight", xlabel="quadrature points")
    axes.set_xticks(counts[::2], map(str, counts[::2]))


def elastica(bending: Callable[[float, float], float]) -> np.ndarray:
    """Tip (x, y), m, of an inextensible cantilever along x with angle'' = bending(s/L, angle), no moment at its tip."""

    def shoot(curvature: float) -> np.ndarray:
        def slope(s: float, y: np.ndarray) -> list[float]:
            return [y[1], bending(s, y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slope, (0, 1), [0, curvature, 0, 0], method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]

    return LENGTH * shoot(brentq(lambda curvature: shoot(curvature)[1], 0, 6, xtol=1e-15))[2:]  # type: ignore[arg-type]


def draw(axes: Axes, i: int, name: str, x: Sequence, misses: Sequence, order: int | None = None) -> None:
    """Plot and print the errors; with ``order``, a line of that slope, and the slope of the four finest."""
    errors = np.linalg.norm(misses, axis=1)
    label = name + (f", dotted: order {abs(order)}" if order else "")
    axes.loglog(x, errors, color=COLOURS[i], marker=MARKS[i], linewidth=1, label=label)
    print(f"  {name:24}", ", ".join(f"{1e6 * error:.2g} um at {at:.3g}" for at, error in zip(x, errors, strict=True)))
    if order:
        axes.loglog(x, errors[-1] * (np.array(x) / x[-1]) ** order, "k:", linewidth=0.8)
        print(f"  {'':24} slope {np.polyfit(np.log(x[-4:]), np.log(errors[-4:]), 1)[0]:.2f}")


if __name__ == "__main__":
    main()
