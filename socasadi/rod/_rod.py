from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import inf
from typing import Any

import casadi as ca
import numpy as np

from ..codegen import compiled
from . import _step
from ._cable import Cable, cables_around
from ._checks import numbers, positive, vector
from ._holding import Holding
from ._linear import Linearisation, Modes, linearise, modes
from ._material import Material, Section
from ._model import RodModel
from ._statics import Equilibrium, Statics
from ._strain import Strain


@dataclass(frozen=True)
class Rod:
    """A soft rod that bends, twists, stretches and shears without limit: a geometrically exact Cosserat rod.

    It is clamped at the origin of the base frame and lies along +x when unloaded and straight. Cables in its
    section pull it. The strain field is a sum of polynomials (:class:`Strain`), whose coefficients q (n,) with their
    rates v (n,) are the state x = [q; v].

    Parameters
    ----------
    length
        L, m.
    section, material, strain
        What it is made of, and which strains it has.
    cables
        In the order of the tensions.
    gravity
        Acceleration (3,), m/s^2, base frame.
    quadrature_points
        Gauss-Legendre points along the rod.

    Notes
    -----
    ``dataclasses.replace(rod, gravity=(9.81, 0, 0))`` is the same rod with one thing changed. Functions are built
    when first used and kept with the rod; they are left out when it is pickled or copied.

    Raises
    ------
    ValueError
        A value is out of range, or there are too few quadrature points for the strain's order, which would leave
        the mass matrix singular. (A cable outside the section is only warned of: discs may carry it.)
    """

    length: float
    section: Section
    material: Material
    strain: Strain
    cables: tuple[Cable, ...] = ()
    gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
    quadrature_points: int = 6

    def __post_init__(self) -> None:
        positive("Rod", length=self.length)
        object.__setattr__(self, "length", float(self.length))
        for name, kind in (("section", Section), ("material", Material), ("strain", Strain)):
            if not isinstance(value := getattr(self, name), kind):
                raise TypeError(f"Rod: {name} is {value!r}, but must be a {kind.__name__}")
        object.__setattr__(self, "cables", tuple(self.cables))
        object.__setattr__(self, "gravity", numbers("Rod", "gravity", self.gravity, 3))
        fewest = max(self.strain.orders) + 1
        points = self.quadrature_points
        if isinstance(points, bool) or not isinstance(points, int) or points < fewest:
            raise ValueError(
                f"Rod: quadrature_points is {points!r}, but must be a whole number of at least {fewest} "
                f"for strains up to order {fewest - 1}"
            )
        if self.section.half_widths is not None:
            y_half, z_half = self.section.half_widths
            for i, cable in enumerate(self.cables):
                y, z = cable.path(0.0)[0][1:]
                if (y / y_half) ** 2 + (z / z_half) ** 2 > 1 + 1e-9:
                    warnings.warn(
                        f"Rod: cable {i} runs at (y, z) = ({y:g}, {z:g}) m, outside the section, which reaches to "
                        f"({y_half:g}, {z_half:g}) m; that is right only if discs carry it",
                        stacklevel=3,
                    )

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
    def dof(self) -> int:
        """Number n of strain coordinates; the state has 2 n entries."""
        return self.strain.dof

    @cached_property
    def model(self) -> RodModel:
        """All equations as CasADi Functions."""
        return RodModel(self)

    @property
    def pose(self) -> ca.Function:
        """CasADi Function (q, s) -> (4, 4) homogeneous pose at arc length s, m, base frame."""
        return self.model.pose

    @property
    def tip(self) -> ca.Function:
        """CasADi Function q -> (3,) tip position, m, base frame."""
        return self.model.tip

    @property
    def mass(self) -> ca.Function:
        """CasADi Function q -> (n, n) mass matrix."""
        return self.model.mass

    @property
    def bias(self) -> ca.Function:
        """CasADi Function (q, v) -> (n,) of inertia, gravity, elasticity and damping: M dv/dt + bias = actuation u."""
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
        """CasADi Function (x, u, tip_force) -> (2 n,) dx/dt under a dead force (3,) N at the tip, base frame."""
        return self.model.forced_rhs

    @property
    def energy(self) -> ca.Function:
        """CasADi Function x -> kinetic, elastic and gravitational energy together, J."""
        return self.model.energy

    @property
    def stiffness(self) -> ca.DM:
        """Elastic stiffness matrix (n, n), constant."""
        return self.model.stiffness

    @property
    def damping_matrix(self) -> ca.DM:
        """Viscous damping matrix (n, n), constant."""
        return self.model.damping_matrix

    def centreline(self, q: Sequence[float] | np.ndarray, n: int = 50) -> np.ndarray:
        """Positions (n, 3), m, of ``n`` points evenly spaced along the rod at coordinates ``q``."""
        q = vector("Rod.centreline", "q", q, self.dof)
        poses = self.pose.map(n)(ca.repmat(ca.DM(q), 1, n), ca.DM(np.linspace(0, self.length, n)).T).full()
        return poses[:3, 3::4].T

    def equilibrium(
        self,
        tension: Sequence[float] | np.ndarray | None = None,
        tip_force: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        tip_moment: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    ) -> Equilibrium:
        """Static equilibrium under constant loads, reached by increasing them (gravity too) from zero.

        Parameters
        ----------
        tension
            Cable tensions (cables,), N; None for slack cables.
        tip_force, tip_moment
            Dead loads (3,) at the tip, N and N m, base frame.

        Raises
        ------
        EquilibriumError
            None was found.
        ValueError
            A load has the wrong shape or is not finite.
        """
        owner, cables = "Rod.equilibrium", len(self.cables)
        tension = np.zeros(cables) if tension is None else vector(owner, "tension", tension, cables)
        force, moment = vector(owner, "tip_force", tip_force, 3), vector(owner, "tip_moment", tip_moment, 3)
        return self._statics.solve(tension, force, moment)

    def equilibrium_at(
        self,
        tip: Sequence[float] | np.ndarray,
        tension_bounds: tuple[Any, Any] = (-inf, inf),
    ) -> Equilibrium:
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
        return Holding(self, self._statics, self._bounds(tension_bounds)).at(tip)

    def resting(self, tension_bounds: tuple[Any, Any] = (-inf, inf)) -> Equilibrium:
        """Static equilibrium under the tensions closest to zero within ``tension_bounds``."""
        return self.equilibrium(np.clip(np.zeros(len(self.cables)), *self._bounds(tension_bounds)))

    def step(self, sample_time: float, substep: float | None = None) -> ca.Function:
        """CasADi Function (x, tension, tip_force) -> x one sample later, compiled when there is a C compiler.

        Parameters
        ----------
        sample_time
            s; tension (cables,) N and tip_force (3,) N, a dead force in the base frame, are held so long.
        substep
            Longest substep of the integration, s. By default 1/250 of the period of the straight rod's slowest
            mode: accuracy asks for that, stability does not.

        Notes
        -----
        A two-stage linearly implicit method of order two, L-stable for the rod's elasticity and damping.
        """
        key = (sample_time, substep)
        if key not in self._steps:
            self._steps[key] = compiled(self.step_expression(sample_time, substep))
        return self._steps[key]

    def step_expression(self, sample_time: float, substep: float | None = None) -> ca.Function:
        """:meth:`step` before compilation, to be part of a larger Function or to be differentiated."""
        if substep is None:
            unloaded = modes(self, self.stiffness.full(), np.zeros(self.dof))
            substep = 1 / (_step.SUBSTEPS_PER_PERIOD * float(unloaded.frequency[0]))
        return _step.w_method(self.model, sample_time, _step.substeps(sample_time, substep))

    def reference_step(self, sample_time: float) -> ca.Function:
        """The same map as :meth:`step` by CVODES at a tolerance of 1e-11: slow, to check against."""
        return _step.reference(self.model, sample_time)

    def linearise(self, equilibrium: Equilibrium | None = None, sample_time: float | None = None) -> Linearisation:
        """A, B, C, D from tensions to the tip (y, z), about ``equilibrium`` (default: at rest with slack cables).

        Continuous time, or with ``sample_time`` (s) discrete time with the tensions held over a sample.
        """
        return linearise(self, equilibrium or self.equilibrium(), sample_time)

    def modes(self, equilibrium: Equilibrium | None = None) -> Modes:
        """Undamped frequencies, Hz, and damping ratios about ``equilibrium`` (default: at rest, cables slack)."""
        at = equilibrium or self.equilibrium()
        return modes(self, self._statics.tangent(at), at.q)

    @cached_property
    def _statics(self) -> Statics:
        return Statics(self)

    @cached_property
    def _steps(self) -> dict[tuple[float, float | None], ca.Function]:
        return {}

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
