"""A robot from its data sheet."""

import tomllib
from math import isfinite, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from ..plant import SimulatedPlant
from ..rod import Cable, Material, Rod, Section, Strain

_NEEDED = {
    "length": "m",
    "bending_stiffness": "N m2",
    "mass_per_length": "kg/m",
    "cable_offset": "m",
}
_SLENDER = (1.0, 1000.0)
"""Between which the length over the cables' offset lies; beyond, one of the two is in another unit."""
_OPTIONAL: dict[str, Any] = {
    "radius": None,
    "cable_angles": [0.0, 120.0, 240.0],
    "damping_ratio": 0.1,
    "poisson": 0.5,
    "gravity": [0.0, 0.0, 0.0],
    "noise": 1e-3,
}
_UNITS = _NEEDED | {"radius": "m", "cable_angles": "degrees", "gravity": "m/s2", "noise": "m"}
_CLOSE = 10.0
"""Degrees within which no arm has all of its cables."""


class SpecSheetError(ValueError):
    """A data sheet that cannot be read; the message says what is wrong with it."""


def read_spec_sheet(path: str | Path, sample_time: float) -> SimulatedPlant:
    """The simulated robot that a data sheet in TOML describes.

    Needed are ``length``, m; ``bending_stiffness``, N m2; ``mass_per_length``, kg/m; ``cable_offset``, m. There may be
    ``cable_angles``, degrees from +y towards +z; ``radius`` of the body, m (1.5 times the cables' offset by default);
    ``damping_ratio`` of the first mode (0.1); ``poisson`` (0.5); ``gravity``, (3,) m/s2, in the base frame, whose x
    axis is the arm's; ``noise``, standard deviation of the sensor's, m (1 mm).

    The rod is a uniform cylinder of that stiffness and mass.

    Raises
    ------
    SpecSheetError
        Anything is missing, unknown or out of range.
    """
    path = Path(path)
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SpecSheetError(f"there is no data sheet {path}") from None
    except IsADirectoryError:
        raise SpecSheetError(f"{path} is a directory, not a data sheet") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SpecSheetError(f"{path} is no TOML: {error}") from None
    names = [*_NEEDED, *_OPTIONAL]
    known = ", ".join(f"{name} ({_UNITS[name]})" if name in _UNITS else name for name in names)
    for name in given:
        if name not in _NEEDED and name not in _OPTIONAL:
            raise SpecSheetError(f"{path} has {name!r}, which no data sheet has here; there are {known}")
    if missing := [name for name in _NEEDED if name not in given]:
        raise SpecSheetError(f"{path} lacks {', '.join(missing)}; a data sheet has {known}")
    sheet = {**_OPTIONAL, **given}
    for name in (*_NEEDED, "damping_ratio", "radius"):
        value = sheet[name]
        if value is not None and not (isinstance(value, int | float) and isfinite(value) and value > 0):
            raise SpecSheetError(f"{path}: {name} is {value!r}, but must be a finite number above zero")
    slender = sheet["length"] / sheet["cable_offset"]
    if not _SLENDER[0] <= slender <= _SLENDER[1]:
        raise SpecSheetError(
            f"{path}: length is {sheet['length']:g} m and cable_offset {sheet['cable_offset']:g} m, a ratio of "
            f"{slender:,.3g}, and no soft arm is so made: are both in m?"
        )
    angles = sheet["cable_angles"]
    if not (isinstance(angles, list) and angles and all(isinstance(angle, int | float) for angle in angles)):
        raise SpecSheetError(f"{path}: cable_angles is {angles!r}, but must be a list of degrees, one a cable")
    if len(angles) > 1 and max(angles) - min(angles) < _CLOSE:
        raise SpecSheetError(
            f"{path}: cable_angles are {angles}, all within {max(angles) - min(angles):.3g} degrees: are they in rad?"
        )
    try:
        return SimulatedPlant(_rod(sheet), sample_time, noise=sheet["noise"])
    except (ValueError, TypeError) as error:
        raise SpecSheetError(f"{path}: {error}") from None


def _rod(sheet: dict[str, Any]) -> Rod:
    radius = 1.5 * sheet["cable_offset"] if sheet["radius"] is None else sheet["radius"]
    area, second = pi * radius**2, pi * radius**4 / 4
    young, density = sheet["bending_stiffness"] / second, sheet["mass_per_length"] / area
    frequency = 1.875104**2 * sqrt(sheet["bending_stiffness"] / (sheet["mass_per_length"] * sheet["length"] ** 4))
    # Kelvin-Voigt bending: damping 3 eta I beside stiffness E I, so that the ratio is 3 eta omega / (2 E).
    damping = 2 * sheet["damping_ratio"] * young / (3 * frequency)
    angles = np.radians(sheet["cable_angles"])
    return Rod(
        length=sheet["length"],
        section=Section.circle(radius),
        material=Material(young=young, poisson=sheet["poisson"], density=density, damping=damping),
        strain=Strain(bending_y=2, bending_z=2, torsion=0, stretch=0),
        cables=[Cable((sheet["cable_offset"] * np.cos(a), sheet["cable_offset"] * np.sin(a))) for a in angles],
        gravity=sheet["gravity"],
    )
