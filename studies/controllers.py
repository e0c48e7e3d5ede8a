"""The controller by itself: six things that the linear MPC can do, each on the paper's soft arm.

    python studies/controllers.py

Nothing is tuned: the prediction model is one oscillator an axis, read off the rod at rest. The sensor has no noise, so
that whatever is left is the controller's. Each block of `gallery` stands alone: what its curves differ in is one
setting of LinearMPC. Errors are of the true tip.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant
from socasadi.mpc import Controller, tables

SAMPLE, ROD = 0.05, Rod.preset("paper")  # s
PLANT = SimulatedPlant(ROD, sample_time=SAMPLE, noise=0)
BASE = LinearMPC(Modal(), sample_time=SAMPLE, horizon=10, Q=1e3, R=1.0, input_bounds=(-10, 10), output_bounds=None)

# theta of Modal: frequency, damping ratio and static gains of each axis, from the rod at rest.
A, B, C, _ = ROD.linearise(sample_time=SAMPLE)
MODES, GAINS = ROD.modes(), C @ np.linalg.solve(np.eye(len(A)) - A, B)
THETA = np.array([(2 * np.pi * MODES.frequency[0], MODES.damping_ratio[0], *gain) for gain in GAINS]).ravel()

TIP, TENSION, PATH = "y / mm", "tension of cable 1 / N", "z / mm"
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#D55E00", "ls": "--"},
    {"color": "#0072B2"},
    {"color": "#009E73", "ls": ":", "lw": 1.4},
)


@dataclass
class Flight:
    """Instants (n + 1,) s, tip and reference (n + 1, 2) mm, tensions (n, 3) N, and the controller afterwards."""

    time: np.ndarray
    tip: np.ndarray
    reference: np.ndarray
    tension: np.ndarray
    controller: Controller

    def error(self, start: float = 0.0) -> np.ndarray:
        """Distance of the tip from its reference after ``start``, mm."""
        return np.linalg.norm(self.tip - self.reference, axis=1)[self.time > start]

    def change(self) -> np.ndarray:
        """Of the tensions from sample to sample (n, 3), N."""
        return np.diff(self.tension, axis=0, prepend=0)

    def rmse(self, start: float = 0.0) -> float:
        return float(np.sqrt(np.mean(self.error(start) ** 2)))


def fly(
    mpc: LinearMPC,
    reference: Callable[[np.ndarray], np.ndarray],
    seconds: float,
    theta: np.ndarray = THETA,
    push: tuple[float, float] = (inf, 0.0),
    late: int = 0,
) -> Flight:
    """From rest; ``push``: from when on, s, which force acts along y, N; tensions act ``late`` samples late."""
    controller, y = mpc.controller(theta), PLANT.reset()
    time = SAMPLE * np.arange(round(seconds / SAMPLE) + 1)
    tip, tension, queue = [y], [], [np.zeros(3)] * late
    for now in time[:-1]:
        ahead = reference(now + SAMPLE * np.arange(1, mpc.reference_rows + 1))  # row 0: one sample from now
        queue.append(controller.step(y, ahead))
        tension.append(queue.pop(0))
        y = PLANT.step(tension[-1], tip_force=(0, push[1] if now >= push[0] else 0, 0))
        tip.append(y)
    return Flight(time, 1e3 * np.array(tip), 1e3 * reference(time), np.array(tension), controller)


def hold(y: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time: np.broadcast_to([y, 0.0], (len(time), 2))


def square(time: np.ndarray) -> np.ndarray:
    """60 mm wide, 2 s for a side, from the middle of one."""
    corners, sides = 0.03 * np.array([(1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)]), (0.5 + time / 2) % 4
    return np.stack([np.interp(sides, np.arange(5), corner) for corner in corners.T], axis=1)


def gallery() -> Iterator[tuple[str, str, dict[str, Flight], Callable[[Flight], str]]]:
    """Title, what is drawn, flights by name, and what is told of each."""
    # A disturbance that is thought to change by a nanometre a sample is not found within a flight: as if not modelled.
    without, halved = replace(BASE, disturbance_noise=1e-9), THETA * np.tile((1, 1, 0.5, 0.5, 0.5), 2)
    flights = {
        "no disturbance model": fly(without, hold(0.03), 12, push=(4, -0.1)),
        "disturbance model": fly(BASE, hold(0.03), 12, push=(4, -0.1)),
        "and gains wrong by half": fly(BASE, hold(0.03), 12, halved, push=(4, -0.1)),
    }
    title = "offset-free: an unknown\nforce of 0.1 N after 4 s"
    yield title, TIP, flights, lambda f: f"{f.error(4).max():.2f} mm at most, {f.error()[-1]:.2f} left after 12 s"

    bounded = replace(BASE, rate_bounds=(-20, 20))
    flights = {"no bound": fly(BASE, hold(0.05), 2), "at most 20 N/s": fly(bounded, hold(0.05), 2)}
    title = "rate bounds: to y = 50 mm\nwith slow winches"
    yield title, TENSION, flights, lambda f: f"{abs(f.change()).max() / SAMPLE:.1f} N/s, RMSE {f.rmse():.2f} mm"

    circle = Circle(radius=0.05, period=20.0).reference
    quadratic = replace(BASE, output_bounds=((-inf, -inf), (0.035, inf)), slack_weight=1e3)
    flights = {
        "quadratic weight": fly(quadratic, circle, 30),
        "and a linear one": fly(replace(quadratic, slack_linear=100.0), circle, 30),
        "quadratic x 100": fly(replace(quadratic, slack_weight=1e5), circle, 30),
    }
    title = "soft outputs: the circle\nbeyond the bound y < 35 mm"
    yield title, PATH, flights, lambda f: f"{(f.tip[f.time > 5, 0] - 35).max():.2f} mm beyond the bound"

    flights = {"next sample seen": fly(replace(BASE, preview=1), square, 20), "horizon seen": fly(BASE, square, 20)}
    title = "preview: a corner of a square\nat 30 mm/s"
    yield title, TIP, flights, lambda f: f"RMSE after 2 s {f.rmse(2):.2f} mm, {f.error(2).max():.2f} at most"

    aware = replace(BASE, delay=2)
    flights = {"not known": fly(BASE, hold(0.03), 5, late=2), "known": fly(aware, hold(0.03), 5, late=2)}
    title = "input delay: tensions act\ntwo samples late"
    yield title, TIP, flights, lambda f: f"RMSE after 1 s {f.rmse(1):.2f} mm, overshoot {f.tip.max() - 30:.2f}"

    blocks = {"1 move": 1, "10 moves": None, "4 moves (1, 1, 2, 6)": (1, 1, 2, 6)}
    flights = {name: fly(replace(BASE, control_horizon=moves), hold(0.05), 2) for name, moves in blocks.items()}
    yield "move blocking: to y = 50 mm\nwith fewer free inputs", TENSION, flights, size


def size(flight: Flight) -> str:
    """What it cost, as the MPC counts, and how large its quadratic program is."""
    mpc, design = flight.controller.mpc, flight.controller.design
    cost = 1e3 * np.sum((1e-3 * flight.error()) ** 2) + np.sum((flight.change() / mpc.input_scale) ** 2)
    given = tables(mpc, design)
    numbers = sum(array.size for array in (*given.arrays.values(), *given.program.arrays.values()))
    return f"J {cost:.2f}, {len(design.hessian)} unknowns, {4e-3 * numbers:.1f} kB of tables (float)"


def draw(axes: Axes, what: str, flights: dict[str, Flight]) -> None:
    """The tension of cable 1 or the tip's y over time, or the tip's path after 5 s."""
    for (name, flight), look in zip(flights.items(), LOOKS, strict=False):
        if what == TENSION:
            axes.step(flight.time[:-1], flight.tension[:, 0], where="post", label=name, **look)
            continue
        if what == PATH:
            wanted, tip = flight.reference.T, flight.tip[flight.time > 5].T
        else:
            wanted, tip = (flight.time, flight.reference[:, 0]), (flight.time, flight.tip[:, 0])
        axes.plot(*wanted, color="k", lw=0.6, label=None if axes.lines else "reference")
        axes.plot(*tip, label=name, **look)
    axes.set(xlabel="y / mm" if what == PATH else "time / s", ylabel=what)


def main() -> None:
    plt.rcParams.update({"font.size": 7, "axes.titlesize": 7, "legend.fontsize": 6.5, "legend.frameon": False})
    plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.1})
    figure, panels = plt.subplots(2, 3, figsize=(7.1, 4.6), layout="constrained")
    for axes, (title, what, flights, tell) in zip(panels.flat, gallery(), strict=True):
        print(title.replace("\n", " "))
        for name, flight in flights.items():
            print(f"  {name:24} {tell(flight)}, {flight.controller.info.fallbacks} fallbacks", flush=True)
        draw(axes, what, flights)
        axes.set_title(title)
        axes.legend()
    panels[0, 2].axvline(35, color="k", ls="-.", lw=0.6)
    panels[0, 2].set(aspect="equal")
    panels[0, 2].legend(loc="center", bbox_to_anchor=(0.42, 0.5))
    panels[1, 0].set(xlim=(6.2, 8), ylim=(5, 36))
    figure.savefig(Path(__file__).parent / "figures" / "controllers.png", dpi=200)
    print(f"\n{BASE.controller(THETA).analysis()}")


if __name__ == "__main__":
    main()
