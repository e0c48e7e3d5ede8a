from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import inf
from typing import Any, Literal

import casadi as ca
import numpy as np

from ..codegen import compiled
from . import _validation, mechanics
from ._checks import numbers, positive_number, vector, whole
from ._symbols import with_numbers
from .body import (
    Cable,
    Chamber,
    DistributedLoad,
    Division,
    Drag,
    Material,
    Payload,
    PointLoad,
    Section,
    Strain,
    cables_around,
)

_ZERO = (0.0, 0.0, 0.0)
_UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, init=False)
class Rod:
    """A soft rod that bends, twists, stretches and shears without limit: a geometrically exact Cosserat rod.

    It is clamped at its base and lies along the base frame's +x when unloaded and straight. One or several
    divisions, each with its section, material and strains, follow one another; cables and chambers in the section
    drive it. The strain coordinates q (n,), those of the first division first, with their rates v (n,) are the state
    x = [q; v].

    Parameters
    ----------
    length, section, material, strain, quadrature_points
        Of a rod of one division, as :class:`Division` has them. Given beside ``divisions``, they replace those
        of every division.
    cables
        :class:`Cable` and :class:`Chamber`, in the order of the inputs.
    divisions
        :class:`Division`, from the base to the tip, in place of the above.
    gravity
        Acceleration (3,), m/s^2, world frame.
    base_rotation, base_position
        The base frame in the world: rotation matrix (3, 3), its columns the base's axes (:func:`pointing` makes one),
        and position (3,), m. By default the two frames are one.
    payloads
        :class:`Payload`, rigid bodies that the rod carries.
    loads
        :class:`PointLoad` and :class:`DistributedLoad`, constant.
    drag
        :class:`Drag` of the fluid around, or None.
    parameters
        CasADi SX symbols that moduli, dimensions of sections, damping, gravity, payloads, loads, cables or rest strain
        are written with. They become the last argument p of every Function of :attr:`model` and of :meth:`step`, which
        can be differentiated in it; a load that changes in time is such a parameter. :meth:`at` gives them values.

    Notes
    -----
    ``dataclasses.replace(rod, gravity=(9.81, 0, 0))`` is the same rod with one thing changed. Functions are built
    when first used and kept with the rod; they are left out when it is pickled or copied.

    Raises
    ------
    ValueError
        A value is out of range. (A cable outside the section is only warned of: discs may carry it.)

    Examples
    --------
    A silicone rod that three cables bend:

    >>> silicone = Material(young=1e6, poisson=0.5, density=1000, damping=1e4)
    >>> rod = Rod(0.6, Section.circle(0.03), silicone, Strain(bending_y=2, bending_z=2), cables_around(3, 0.02))
    >>> rod.equilibrium(tension=[5, 0, 0]).tip[:2].round(3).tolist()
    [0.599, 0.028]

    An arm of two divisions, the second thinner, with a gripper, whose Young's modulus is to be identified:

    >>> E = ca.SX.sym("E")
    >>> rubber = Material(E, 0.5, 1100, damping=1e4)
    >>> thick, thin = (Division(0.3, Section.circle(r), rubber, Strain(bending_y=1, bending_z=1)) for r in (0.03, 0.02))
    >>> arm = Rod(divisions=(thick, thin), gravity=(0, 0, -9.81), payloads=(Payload(0.05),), parameters=(E,))
    >>> arm.model.rhs
    Function(rhs:(x[16],u[0],p)->(xdot[16]) MXFunction)
    >>> arm.at([1e6]).equilibrium().tip[[0, 2]].round(3).tolist()
    [0.439, -0.368]
    """

    divisions: tuple[Division, ...]
    cables: tuple[Cable | Chamber, ...]
    gravity: tuple[Any, ...]
    base_rotation: tuple[tuple[float, ...], ...]
    base_position: tuple[float, ...]
    payloads: tuple[Payload, ...]
    loads: tuple[PointLoad | DistributedLoad, ...]
    drag: Drag | None
    parameters: tuple[ca.SX, ...]

    def __init__(
        self,
        length: float | None = None,
        section: Any = None,
        material: Material | None = None,
        strain: Strain | None = None,
        cables: Cable | Chamber | Sequence[Cable | Chamber] = (),
        *,
        divisions: Sequence[Division] | Division = (),
        gravity: Sequence[Any] = _ZERO,
        base_rotation: Any = _UPRIGHT,
        base_position: Sequence[float] = _ZERO,
        payloads: Payload | Sequence[Payload] = (),
        loads: PointLoad | DistributedLoad | Sequence[PointLoad | DistributedLoad] = (),
        drag: Drag | None = None,
        quadrature_points: int | None = None,
        parameters: ca.SX | Sequence[ca.SX] = (),
    ) -> None:
        given = {
            name: value
            for name, value in (
                ("length", length),
                ("section", section),
                ("material", material),
                ("strain", strain),
                ("quadrature_points", quadrature_points),
            )
            if value is not None
        }
        put = object.__setattr__
        put(self, "divisions", _validation.one_or_several(divisions, given))
        put(self, "cables", _validation.all_of("cables", cables, (Cable, Chamber)))
        put(self, "gravity", numbers("Rod", "gravity", gravity, 3))
        put(self, "base_rotation", _validation.rotation(base_rotation))
        put(self, "base_position", tuple(vector("Rod", "base_position", base_position, 3).tolist()))
        put(self, "payloads", _validation.all_of("payloads", payloads, (Payload,)))
        put(self, "loads", _validation.all_of("loads", loads, (PointLoad, DistributedLoad)))
        put(self, "drag", drag)
        columns = _validation.all_of("parameters", parameters, (ca.SX,))
        put(self, "parameters", tuple(symbol for column in columns for symbol in ca.vertsplit(ca.vec(column))))
        if drag is not None and not isinstance(drag, Drag):
            raise TypeError(f"Rod: drag is {drag!r}, but must be a Drag or None")
        _validation.check_places(self)
        _validation.check_symbols(self)
        _validation.warn_of_cables_outside(self)

    @classmethod
    def preset(cls, name: str) -> Rod:
        """A rod by name.

        ``paper``
            SoRoSim's default link: silicone, 0.6 m long, radius 0.03 m, three cables at 0.02 m; no gravity.
            8 coordinates: quadratic curvature about y and z, constant torsion and stretch.
        ``hanging``
            The same rod, hung with gravity along it.
        ``paper_literal``
            The rod of Pal, He and Wei (arXiv 2210.08780) as printed, of radius 0.1 m, with cables at the surface:
            10 N move its tip by millimetres.

        Raises
        ------
        ValueError
            No preset has that name; the message lists those that exist.
        """
        radii = {"paper": (0.03, 0.02), "hanging": (0.03, 0.02), "paper_literal": (0.1, 0.1)}
        if name not in radii:
            raise ValueError(f"Rod.preset: no preset is called {name!r}; there are {', '.join(radii)}")
        radius, offset = radii[name]
        return cls(
            length=0.6,
            section=Section.circle(radius),
            material=Material(young=1e6, poisson=0.5, density=1000.0, damping=1.1e4),
            strain=Strain(bending_y=2, bending_z=2, torsion=0, stretch=0),
            cables=cables_around(3, offset),
            gravity=(9.81, 0.0, 0.0) if name == "hanging" else (0.0, 0.0, 0.0),
        )

    @property
    def length(self) -> float:
        """Length of the unloaded rod, m."""
        return sum(division.length for division in self.divisions)

    @property
    def dof(self) -> int:
        """Number n of strain coordinates; the state has 2 n entries."""
        return sum(division.dof for division in self.divisions)

    @cached_property
    def model(self) -> mechanics.RodModel:
        """All equations as CasADi Functions, those below and more."""
        return mechanics.RodModel(self)

    @property
    def pose(self) -> ca.Function:
        """CasADi Function (q, s) -> (4, 4) homogeneous pose at arc length s, m, world frame."""
        return self.model.pose

    @property
    def tip(self) -> ca.Function:
        """CasADi Function q -> (3,) tip position, m, world frame."""
        return self.model.tip

    @property
    def mass(self) -> ca.Function:
        """CasADi Function q -> (n, n) mass matrix."""
        return self.model.mass

    @property
    def bias(self) -> ca.Function:
        """CasADi Function (q, v) -> (n,): mass dv/dt + bias = actuation tension."""
        return self.model.bias

    @property
    def actuation(self) -> ca.Function:
        """CasADi Function q -> (n, cables), generalised force per newton of tension."""
        return self.model.actuation

    @property
    def rhs(self) -> ca.Function:
        """CasADi Function (x, u) -> (2 n,) dx/dt."""
        return self.model.rhs

    @property
    def forced_rhs(self) -> ca.Function:
        """CasADi Function (x, u, tip_force) -> (2 n,) dx/dt under a dead force (3,) N at the tip, world frame."""
        return self.model.forced_rhs

    @property
    def energy(self) -> ca.Function:
        """CasADi Function x -> kinetic, elastic and gravitational energy together, J."""
        return self.model.energy

    @property
    def stiffness(self) -> ca.DM:
        """Elastic stiffness matrix (n, n), constant."""
        return self.valued.model.stiffness  # type: ignore[return-value]

    @property
    def damping_matrix(self) -> ca.DM:
        """Viscous damping matrix (n, n), constant."""
        return self.valued.model.damping_matrix  # type: ignore[return-value]

    @property
    def neutral(self) -> np.ndarray:
        """Inputs (cables,) that do nothing to the unloaded rod: zero, or the length that a cable has there, m."""
        return self.statics.neutral

    def at(self, values: Sequence[float] | np.ndarray) -> Rod:
        """The rod with ``values`` for its :attr:`parameters`, in their order: a rod of numbers, ready to simulate.

        Raises
        ------
        ValueError
            There are not as many values as parameters, one is not finite, or one gives the rod what no rod can have.
        """
        if not self.parameters:
            raise ValueError("Rod.at: the rod has no parameters, so there is nothing to give values to")
        symbols = ca.vertcat(ca.SX(0, 1), *self.parameters)
        given = ca.DM(vector("Rod.at", "values", values, len(self.parameters)))
        parts: dict[str, Any] = {f.name: with_numbers(getattr(self, f.name), symbols, given) for f in fields(self)}
        return Rod(**{**parts, "parameters": ()})

    @property
    def base_pose(self) -> np.ndarray:
        """Homogeneous pose (4, 4) of the base in the world."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.base_rotation, self.base_position
        return pose

    @property
    def valued(self) -> Rod:
        """This rod; ValueError when parameters have no values, which a simulation in numbers needs."""
        if self.parameters:
            names = ", ".join(str(symbol) for symbol in self.parameters)
            raise ValueError(f"Rod: the parameters {names} have no values; use rod.at([...]) to give them")
        return self

    def in_base_frame(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world, m, as the base sees them."""
        return (points - np.array(self.base_position)) @ np.array(self.base_rotation)

    def frames(self, q: Sequence[float] | np.ndarray, n: int = 50) -> np.ndarray:
        """Homogeneous poses (n, 4, 4) of ``n`` sections evenly spaced along the rod at ``q``, world frame."""
        q = vector("Rod", "q", q, self.dof)
        n = whole("Rod", "n", n, 2)
        poses = self.valued.pose.map(n)(ca.repmat(ca.DM(q), 1, n), ca.DM(np.linspace(0, self.length, n)).T).full()
        return poses.reshape(4, n, 4).swapaxes(0, 1)

    def centreline(self, q: Sequence[float] | np.ndarray, n: int = 50) -> np.ndarray:
        """Positions (n, 3), m, of ``n`` points evenly spaced along the rod at coordinates ``q``, world frame."""
        return self.frames(q, n)[:, :3, 3]

    def equilibrium(
        self,
        tension: Sequence[float] | np.ndarray | None = None,
        tip_force: Sequence[Any] | np.ndarray = _ZERO,
        tip_moment: Sequence[Any] | np.ndarray = _ZERO,
        *,
        follower_force: Sequence[Any] | np.ndarray = _ZERO,
        follower_moment: Sequence[Any] | np.ndarray = _ZERO,
        lengths: Sequence[float] | np.ndarray | None = None,
        near: mechanics.Equilibrium | None = None,
    ) -> mechanics.Equilibrium:
        """Static equilibrium under constant loads, reached by increasing them together from zero.

        A rod that buckles on the way follows the branch that an imperfection points to: a side load of some 1e-4 of
        what makes it buckle, or a rest curvature. A perfect one stays on the straight branch, and the equilibrium's
        ``stability`` is below zero.

        Parameters
        ----------
        tension
            Inputs (cables,): tensions, N, or what else cables and chambers take; None for :attr:`neutral`.
        tip_force, tip_moment
            Dead loads (3,) at the tip, N and N m, world frame.
        follower_force, follower_moment
            Loads (3,) that turn with the tip section, N and N m, in its axes.
        lengths
            Lengths (cables,), m, that the cables are to have, in place of ``tension``: the equilibrium's ``tension``
            says what that takes.
        near
            An equilibrium of this rod under loads much like these, from which Newton's method starts: several times
            quicker. Where it leads nowhere, the loads are increased from zero all the same.

        Raises
        ------
        EquilibriumError
            None was found.
        ValueError
            A load has the wrong shape or is not finite, or ``near`` is another rod's.

        Examples
        --------
        >>> rod = Rod.preset("paper")
        >>> rod.equilibrium(tip_force=(0, 0, -1)).tip[[0, 2]].round(3).tolist()
        [0.588, -0.109]
        >>> bent = rod.equilibrium(lengths=[0.59, 0.605, 0.605])
        >>> bent.tension.round(2).tolist()
        [17.67, -8.84, -8.84]
        """
        owner, cables = "Rod.equilibrium", len(self.cables)
        loads = {
            "tip_moment": tip_moment,
            "tip_force": tip_force,
            "follower_moment": follower_moment,
            "follower_force": follower_force,
        }
        tip_load = np.concatenate([vector(owner, name, load, 3) for name, load in loads.items()])
        if lengths is None:
            given = self.neutral if tension is None else vector(owner, "tension", tension, cables)
            return self.statics.solve(given, tip_load, None if near is None else self._own(near).q)
        if tension is not None:
            raise ValueError(f"{owner}: both tension and lengths are given, but one follows from the other")
        return self.statics.solve_lengths(vector(owner, "lengths", lengths, cables), tip_load)

    def equilibrium_at(
        self,
        tip: Sequence[float] | np.ndarray,
        tension_bounds: tuple[Any, Any] = (-inf, inf),
    ) -> mechanics.Equilibrium:
        """Static equilibrium with the tip at ``tip`` = (y, z), m, held by the tensions of least norm.

        Parameters
        ----------
        tip
            (2,), m, base frame.
        tension_bounds
            (lower, upper), N, each a number or one per cable.

        Raises
        ------
        EquilibriumError
            The tip is out of reach; the message says by how much.
        ValueError
            A shape is wrong, a value is not finite, or the bounds cross.
        """
        return mechanics.Holding(self, self.statics, self._bounds(tension_bounds)).at(tip)

    def resting(self, tension_bounds: tuple[Any, Any] = (-inf, inf)) -> mechanics.Equilibrium:
        """Static equilibrium under the inputs closest to :attr:`neutral` within ``tension_bounds``."""
        return self.equilibrium(np.clip(self.neutral, *self._bounds(tension_bounds)))

    def step(self, sample_time: float, substep: float | None = None) -> ca.Function:
        """CasADi Function (x, tension, tip_force) -> x one sample later, compiled when there is a C compiler.

        For its C or its derivatives take :meth:`step_expression`, the same Function before compilation.

        Parameters
        ----------
        sample_time
            s; tension (cables,) N and tip_force (3,) N, a dead force in the world frame, are held so long. Free
            parameters are a last argument p.
        substep
            Longest substep of the integration, s. By default 1/250 of the period of the straight rod's slowest mode or
            1/40 of that of its fourth, whichever is shorter; a rod with parameters needs it given. Stiff strains ask
            for no less, fast motion (a slender rod that whips through radians in a few ms) does.

        Notes
        -----
        A two-stage linearly implicit method of order two, L-stable for the rod's elasticity and damping. To judge an
        answer, halve the substep, raise the strains' orders and the quadrature points until it stays.

        The method takes a little energy: over tens of periods an undamped rod needs shorter substeps. Thrown through
        several radians without any damping it may diverge (the state is then not finite), seen with substeps down to a
        quarter of the default; 2 % of damping in the first mode were enough there.
        """
        key = (sample_time, substep)
        if key not in self._steps:
            self._steps[key] = compiled(self.step_expression(sample_time, substep))
        return self._steps[key]

    def step_expression(self, sample_time: float, substep: float | None = None) -> ca.Function:
        """:meth:`step` before compilation: to be differentiated, generated as C, or part of a larger Function.

        Examples
        --------
        How the tip after a sample of 50 ms depends on Young's modulus:

        >>> E = ca.SX.sym("E")
        >>> rubber = Material(E, 0.5, 1000, damping=1e4)
        >>> rod = Rod(0.6, Section.circle(0.03), rubber, Strain(bending_z=1), Cable((0.02, 0)), parameters=E)
        >>> advance, young = rod.step_expression(0.05, substep=0.005), ca.MX.sym("E")
        >>> x = advance(np.zeros(4), [5.0], np.zeros(3), young)
        >>> slope = ca.Function("slope", [young], [ca.jacobian(rod.tip(x[:2], young), young)])
        >>> slope(1e6)[1] < 0
        DM(1)
        """
        if substep is None and self.parameters:
            raise ValueError(
                "Rod.step: substep is not given, and its default follows from the values of the parameters; give it, s"
            )
        return mechanics.w_method(self.model, sample_time, mechanics.substeps(self, sample_time, substep))

    def reference_step(
        self, sample_time: float, method: Literal["cvodes", "collocation"] = "cvodes", elements: int = 10
    ) -> ca.Function:
        """The same map as :meth:`step` by CasADi's own integrators: slow, to check against.

        "cvodes" is Sundials' multistep method at a tolerance of 1e-11, "collocation" Legendre collocation of degree 4
        on ``elements`` intervals.
        """
        positive_number("Rod.reference_step", sample_time=sample_time)
        whole("Rod.reference_step", "elements", elements, 1)
        if method not in ("cvodes", "collocation"):
            raise ValueError(f"Rod.reference_step: method is {method!r}, but must be 'cvodes' or 'collocation'")
        return mechanics.reference(self.model, sample_time, method, elements)

    def linearise(
        self,
        equilibrium: mechanics.Equilibrium | None = None,
        sample_time: float | None = None,
        output: ca.Function | None = None,
    ) -> mechanics.Linearisation:
        """A, B, C, D about ``equilibrium`` (default: at rest with :attr:`neutral` inputs), which holds the loads too.

        Continuous time, or with ``sample_time`` (s) discrete time with the inputs held over a sample. The output is the
        tip's (y, z) in the base frame, or a CasADi Function of the state x.

        Examples
        --------
        >>> A, B, C, D = Rod.preset("paper").linearise(sample_time=0.05)
        >>> A.shape, B.shape, C.shape
        ((16, 16), (16, 3), (2, 16))
        """
        return mechanics.linearise(self.valued, self._own(equilibrium), sample_time, output)

    def modes(self, equilibrium: mechanics.Equilibrium | None = None) -> mechanics.Modes:
        """Undamped frequencies, Hz, and damping ratios about ``equilibrium`` (default: as in :meth:`linearise`).

        Examples
        --------
        >>> Rod.preset("paper").modes().frequency[:2].round(4).tolist()
        [0.7365, 0.7365]
        """
        at = self._own(equilibrium)
        return mechanics.modes(self.valued, at.stiffness, at.q)

    @cached_property
    def statics(self) -> mechanics.Statics:
        """Newton's method for this rod's equilibria, behind :meth:`equilibrium`."""
        return mechanics.Statics(self.valued)

    @cached_property
    def _steps(self) -> dict[tuple[float, float | None], ca.Function]:
        return {}

    def _own(self, equilibrium: mechanics.Equilibrium | None) -> mechanics.Equilibrium:
        """An equilibrium of this rod, the one with neutral inputs unless one is given."""
        if equilibrium is None:
            return self.equilibrium()
        if not isinstance(equilibrium, mechanics.Equilibrium):
            raise TypeError(f"Rod: equilibrium is {equilibrium!r}, but must be an Equilibrium, as equilibrium() gives")
        shapes = (len(equilibrium.q), len(equilibrium.input))
        if shapes != (self.dof, len(self.cables)):
            raise ValueError(
                f"Rod: the equilibrium is another rod's: it has {shapes[0]} coordinates and {shapes[1]} inputs, "
                f"this rod {self.dof} and {len(self.cables)}"
            )
        return equilibrium

    def _bounds(self, bounds: tuple[Any, Any]) -> tuple[np.ndarray, np.ndarray]:
        try:
            lower, upper = (np.broadcast_to(np.asarray(b, dtype=float), (len(self.cables),)) for b in bounds)
        except (TypeError, ValueError):
            raise ValueError(
                f"tension_bounds is {bounds!r}, but must be (lower, upper), each a number or {len(self.cables)} numbers"
            ) from None
        if not ((lower <= upper) & (lower < inf) & (upper > -inf)).all():
            raise ValueError(f"tension_bounds is {bounds!r}, but no lower bound may be above its upper bound")
        return lower, upper

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}
