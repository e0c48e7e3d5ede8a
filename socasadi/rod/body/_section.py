from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, Literal

import casadi as ca

from .._checks import Number, numbers, positive, symbolic

_TORSION_TERMS = 40  # odd terms of Saint-Venant's series for a rectangle; the first left out is below 1e-9


@dataclass(frozen=True)
class Section:
    """A cross-section by its constants, in principal axes y and z through the centroid.

    :meth:`circle`, :meth:`tube`, :meth:`ellipse` and :meth:`rectangle` know theirs; any other shape is given by
    numbers.

    Parameters
    ----------
    area
        A, m^2.
    Iy, Iz
        Second moments of area about y and z, m^4.
    torsion_constant
        J, m^4, so that the torsional stiffness is G J: the polar moment for a circle, Saint-Venant's constant
        for other shapes. None takes the polar moment.
    half_widths
        Half the section's size along y and along z, m: where cables may be, and what is drawn.
    outline
        "ellipse" or "rectangle": which of the two the half widths bound.
    shear_correction
        Factor on the shear stiffness G A; 1 for none.

    Raises
    ------
    ValueError
        A value is not above zero.

    Examples
    --------
    >>> from dataclasses import replace
    >>> blade = replace(Section.rectangle(0.02, 0.004), shear_correction=5 / 6)
    """

    area: Number
    Iy: Number
    Iz: Number
    torsion_constant: Number | None = None
    half_widths: tuple[Number, Number] | None = None
    outline: Literal["ellipse", "rectangle"] = "ellipse"
    shear_correction: Number = 1.0

    def __post_init__(self) -> None:
        names = ("area", "Iy", "Iz", "shear_correction")
        positive("Section", **{name: getattr(self, name) for name in names}, torsion_constant=self.J)
        if self.half_widths is not None:
            y, z = numbers("Section", "half_widths", self.half_widths, 2)
            positive("Section", half_width_y=y, half_width_z=z)
            object.__setattr__(self, "half_widths", (y, z))
        if self.outline not in ("ellipse", "rectangle"):
            raise ValueError(f"Section: outline is {self.outline!r}, but must be 'ellipse' or 'rectangle'")

    @property
    def J(self) -> Number:
        """The torsion constant, m^4."""
        return self.Ix if self.torsion_constant is None else self.torsion_constant

    @property
    def Ix(self) -> Number:
        """Polar second moment of area Iy + Iz, m^4."""
        return self.Iy + self.Iz

    def contains(self, y: float, z: float) -> bool:
        """Whether the point lies within the outline; yes where that is not known."""
        if self.half_widths is None or symbolic(self.half_widths):
            return True
        y, z = y / float(self.half_widths[0]), z / float(self.half_widths[1])
        reach = y**2 + z**2 if self.outline == "ellipse" else max(y**2, z**2)
        return reach <= 1 + 1e-9

    @classmethod
    def circle(cls, radius: Number, torsion_constant: Number | None = None) -> Section:
        """Full circle of ``radius``, m; its torsion constant is the polar moment unless given."""
        positive("Section.circle", radius=radius)
        moment = pi * radius**4 / 4
        return cls(pi * radius**2, moment, moment, torsion_constant, (radius, radius))

    @classmethod
    def tube(cls, radius: Number, inner_radius: Number) -> Section:
        """Hollow circle of outer ``radius`` and ``inner_radius``, m."""
        positive("Section.tube", radius=radius, inner_radius=inner_radius)
        if not symbolic((radius, inner_radius)) and inner_radius >= radius:
            raise ValueError(
                f"Section.tube: inner_radius is {inner_radius!r} m, but must be less than the radius, {radius!r} m"
            )
        moment = pi * (radius**4 - inner_radius**4) / 4
        return cls(pi * (radius**2 - inner_radius**2), moment, moment, None, (radius, radius))

    @classmethod
    def ellipse(cls, half_width_y: Number, half_width_z: Number) -> Section:
        """Ellipse of semi-axes ``half_width_y`` and ``half_width_z``, m; J = pi a^3 b^3 / (a^2 + b^2)."""
        positive("Section.ellipse", half_width_y=half_width_y, half_width_z=half_width_z)
        a, b = half_width_y, half_width_z
        torsion = pi * a**3 * b**3 / (a**2 + b**2)
        return cls(pi * a * b, pi * a * b**3 / 4, pi * a**3 * b / 4, torsion, (a, b))

    @classmethod
    def rectangle(cls, width_y: Number, width_z: Number) -> Section:
        """Rectangle of sides ``width_y`` and ``width_z``, m.

        Its torsion constant is Saint-Venant's series (Timoshenko and Goodier, Theory of Elasticity, art. 109):
        J = a b^3 (1/3 - 64/pi^5 (b/a) sum over odd n of tanh(n pi a / 2 b) / n^5).
        """
        positive("Section.rectangle", width_y=width_y, width_z=width_z)
        a, b = width_y, width_z
        series = sum(ca.tanh(n * pi * a / (2 * b)) / n**5 for n in range(1, 2 * _TORSION_TERMS, 2))
        torsion: Any = a * b**3 * (1 / 3 - 64 / pi**5 * (b / a) * series)
        return cls(a * b, a * b**3 / 12, a**3 * b / 12, torsion, (a / 2, b / 2), "rectangle")


@dataclass(frozen=True)
class Taper:
    """A section whose dimensions change linearly along a division.

    Parameters
    ----------
    shape
        "circle", "tube", "ellipse" or "rectangle", by the constructors of :class:`Section`.
    base, tip
        That constructor's dimensions, m, at either end: a number, or one each.

    Raises
    ------
    ValueError
        The shape is not known, or a section at an end is not possible.

    Examples
    --------
    >>> Taper("circle", base=0.03, tip=0.01)(0.5) == Section.circle(0.02)
    True
    """

    shape: Literal["circle", "tube", "ellipse", "rectangle"]
    base: Any
    tip: Any

    def __post_init__(self) -> None:
        shapes = ("circle", "tube", "ellipse", "rectangle")
        if self.shape not in shapes:
            raise ValueError(f"Taper: shape is {self.shape!r}, but must be one of {', '.join(shapes)}")
        for name in ("base", "tip"):
            given = getattr(self, name)
            given = given if isinstance(given, list | tuple) else (given,)
            object.__setattr__(self, name, numbers("Taper", name, given, 1 if self.shape == "circle" else 2))
        for end in (0.0, 1.0):
            self(end)

    def __call__(self, x: float) -> Section:
        """The section at ``x``, 0 at the division's base and 1 at its tip."""
        return getattr(Section, self.shape)(*(a + (b - a) * x for a, b in zip(self.base, self.tip, strict=True)))
