"""Twelve soft rods at rest: what a rod can be made of and loaded with, and the shape that it then takes.

    python studies/rods.py

Each block of `gallery` stands alone. All rods are of silicone rubber of 0.4 MPa; the world's z axis points up. What is
printed is for the last shape of a panel; its stability is that of its tangent stiffness, 1 without loads and 0 where
the rod buckles.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, pi, radians, sin
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.colors import to_rgb

from socasadi import Rod
from socasadi.rod import (
    Cable,
    Chamber,
    Converging,
    DistributedLoad,
    Division,
    Equilibrium,
    Helix,
    Material,
    Payload,
    Section,
    Strain,
    Taper,
    cables_around,
    pointing,
)

RUBBER, THIN, THICK = Material(young=4e5, poisson=0.5, density=1070.0), Section.circle(0.008), Section.circle(0.02)
FREE = Strain(bending_y=6, bending_z=6, torsion=4, stretch=1)
EI, DOWN = 4e5 * pi * 0.008**4 / 4, (0, 0, -9.81)  # of a thin rod, N m^2
UPRIGHT = pointing((0, 0, 1))

# Where the eye is: rows to the right, up, and towards it.
SIDE, ABOVE = ((1, 0, 0), (0, 0, 1), (0, -1, 0)), ((1, 0, 0), (0, 1, 0), (0, 0, 1))
OBLIQUE = ((0.866, 0.5, 0), (-0.211, 0.366, 0.906), (0.453, -0.785, 0.423))
WIDTH, HEIGHT, COLOURS = 370, 310, ("#0072B2", "#D55E00", "#009E73", "#A6548A")


def gallery() -> Iterator[tuple[str, object, list[Equilibrium]]]:
    """Title, view, and shapes, of which the last is drawn in full colour."""
    rod = Rod(0.27, THIN, RUBBER, Strain(bending_z=0))
    shapes = [rod.equilibrium(tip_moment=(0, 0, part * 2 * pi * EI / 0.27)) for part in (0, 1 / 3, 2 / 3, 1)]
    yield "a moment at the tip\nrolls up a full circle", ABOVE, shapes

    rod = Rod(0.27, THIN, RUBBER, FREE, [Cable(Helix(radius=0.006, pitch=0.14))], base_rotation=UPRIGHT)
    yield "one helical cable\nmakes a corkscrew", OBLIQUE, [rod.equilibrium(tension=[pull]) for pull in (0, 3, 6)]

    places = ((0.015, 0), (0, 0.015), (-0.015, 0), (0, -0.015))
    cables = [Cable(Converging((y, z), (y / 6, z / 6), length=0.32)) for y, z in places]
    rod = Rod(0.32, Taper("circle", base=0.018, tip=0.003), RUBBER, FREE, cables)
    yield "octopus arm: taper\nand converging cables", ABOVE, [rod.equilibrium([pull, 0, 0, 0]) for pull in (0, 1, 2.5)]

    chambers = [Chamber(cable.route, area=1.5e-4) for cable in cables_around(3, 0.011)]
    rod = Rod(0.22, THICK, RUBBER, FREE, chambers, base_rotation=UPRIGHT)
    yield "1 bar of air in one\nof three chambers", OBLIQUE, [rod.equilibrium(1e5 * one) for one in np.eye(3)]

    fingers = []
    for side in (1, -1):
        place = {"base_rotation": ((0, 0, side), (0, side, 0), (-1, 0, 0)), "base_position": (-0.08 * side, 0, 0)}
        moulded = Strain(bending_y=3, rest=(0, 5, 0, 1, 0, 0))
        fingers.append(Rod(0.18, Section.rectangle(0.016, 0.016), RUBBER, moulded, [Cable((0, 0.007))], **place))
    yield (
        "fingers moulded open:\na cable closes each",
        SIDE,
        [f.equilibrium([pull]) for pull in (0, 3) for f in fingers],
    )

    half = Division(0.15, THIN, RUBBER, FREE)
    rod = Rod(divisions=(half, half), cables=[Cable((0, -0.006)), Cable((0, 0.006), end=0.15)])
    yield "two divisions: cables of\nfull and half length", SIDE, [rod.equilibrium([t, 2.5 * t]) for t in (0, 1, 2)]

    place = {"base_rotation": pointing((cos(radians(50)), 0, sin(radians(50)))), "gravity": DOWN}
    loads = ([], [Payload(0.2)], [Payload(0.2, s=0.12)])
    rods = [Rod(0.24, THICK, RUBBER, FREE, payloads=load, **place) for load in loads]
    yield "gravity; 200 g at the tip\nor half-way", SIDE, [rod.equilibrium() for rod in rods]

    rod = Rod(0.26, THIN, RUBBER, Strain(bending_y=10))
    shapes = [rod.equilibrium(follower_force=(0, 0, a * EI / 0.26**2)) for a in (0, 3, 10, 26)]
    yield "a jet across the tip\nthat turns with the tip", SIDE, shapes

    rods = [Rod(0.3, THIN, RUBBER, FREE, [Cable((0, 0.006), friction=mu)]) for mu in (0.6, 0.3, 0)]
    yield "friction 0.6, 0.3, 0\nof the same cable", SIDE, [rod.equilibrium(tension=[5]) for rod in rods]

    reed = Rod(0.25, Taper("circle", 0.008, 0.003), RUBBER, Strain(bending_y=8), base_rotation=UPRIGHT)
    winds = [[DistributedLoad(lambda s, i=i: (0.7 * i * s, 0, 0))] for i in range(5)]
    rods = [replace(reed, loads=wind, base_position=(0.04 * i, 0, 0)) for i, wind in enumerate(winds)]
    yield "reeds in a wind that\ngrows with height", SIDE, [rod.equilibrium() for rod in rods]

    rod = Rod(0.22, THICK, RUBBER, FREE, cables_around(3, 0.018), base_rotation=UPRIGHT)
    lengths = 0.22 + 0.02 * np.cos(np.add.outer(np.arange(6) * pi / 3, np.arange(3) * 2 * pi / 3))
    yield "winches that set the\nlengths of three cables", OBLIQUE, [rod.equilibrium(lengths=row) for row in lengths]

    critical = (7.8373 * EI / (1070 * pi * 0.008**2 * 9.81)) ** (1 / 3)
    column = Rod(critical, THIN, RUBBER, Strain(bending_y=6), base_rotation=UPRIGHT, gravity=DOWN)
    rods = [replace(column, length=(0.7 + 0.1 * i) * critical, base_position=(0.035 * i, 0, 0)) for i in range(5)]
    yield (
        "pushed by 30 mN: columns of\n0.7 to 1.1 self-buckling heights",
        SIDE,
        [rod.equilibrium(tip_force=(0.03, 0, 0)) for rod in rods],
    )


def main() -> None:
    plt.rcParams.update({"font.size": 7, "axes.titlesize": 7})
    figure, panels = plt.subplots(3, 4, figsize=(7.1, 5.4), layout="constrained")
    for axes, colour, (title, view, shapes) in zip(panels.flat, 3 * COLOURS, gallery(), strict=True):
        x, y, z = 1e3 * shapes[-1].tip
        name = title.replace("\n", " ")
        print(f"{name:60} tip ({x:6.1f}, {y:6.1f}, {z:6.1f}) mm, stability {shapes[-1].stability:5.2f}", flush=True)
        draw(axes, shapes, np.array(view), np.array(to_rgb(colour)))
        axes.set_title(title)
    axes = panels[-1, 0]
    axes.plot([0.05, 0.05 + 100 / WIDTH], [0.04, 0.04], "k", transform=axes.transAxes)
    axes.text(0.05, 0.06, "100 mm, all panels", transform=axes.transAxes)
    figure.savefig(Path(__file__).parent / "figures" / "rods.png", dpi=200)


def draw(axes: Axes, shapes: list[Equilibrium], view: np.ndarray, colour: np.ndarray) -> None:
    """Rods as strings of shaded balls, far ones first, and their cables; shapes in a plane lie over earlier ones."""
    flat, discs = bool((np.abs(view) == 1).any()), []  # each: depth, x, y, radius, red, green, blue
    for k, shape in enumerate(shapes):
        pale = 0.8 * (1 - (k + 1) / len(shapes)) if flat else 0
        for s, offset, radius, tone, before in balls(shape.rod, colour):
            centre = shape.rod.pose(shape.q, s).full()[:3] @ (0, *offset, 1)
            x, y, depth = 1e3 * view @ centre + (0, 0, 1e3 * k * flat + before)
            for part in (1, 0.9, 0.75, 0.55, 0.3):
                shade = 0.55 * tone if part == 1 else tone + 0.45 * (1 - part) * (1 - tone)
                lit, near = 0.3 * (1 - part) * radius, radius * np.sqrt(1 - part**2)
                discs.append((depth + near, x - lit, y + lit, part * radius, *(shade + pale * (1 - shade))))
    _, x, y, radius, *tones = np.array(sorted(discs, key=lambda disc: disc[0])).T
    size = {"widths": 2 * radius, "heights": 2 * radius, "angles": 0 * radius, "units": "xy", "linewidths": 0}
    place = {"offsets": np.stack([x, y], axis=1), "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(**size, **place, facecolors=np.stack(tones, axis=1)))
    x, y = (min(x) + max(x)) / 2, (min(y) + max(y)) / 2
    axes.set(xlim=(x - WIDTH / 2, x + WIDTH / 2), ylim=(y - HEIGHT / 2, y + HEIGHT / 2), aspect="equal")
    axes.axis("off")


def balls(rod: Rod, colour: np.ndarray) -> Iterator[tuple[float, tuple[float, float], float, np.ndarray, float]]:
    """Arc length and offset in the section, m, radius, mm, colour, and how far before its place it is drawn, mm."""
    for s in np.linspace(0, rod.length, 300):
        radius = 1e3 * float((rod.divisions[0].section_at(s / rod.length).half_widths or (0, 0))[1])
        yield s, (0, 0), radius, colour, 0
        for cable in rod.cables:
            if s <= (cable.end or rod.length):
                yield s, cable.at(s), 0.7, colour / 4, 2 * radius
    for load in rod.payloads:
        yield load.s or rod.length, (0, 0), 26, np.full(3, 0.4), 0


if __name__ == "__main__":
    main()
