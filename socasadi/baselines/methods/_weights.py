from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from ...campaign import Pilot
from ...model import Fixed, StateSpace, subspace
from ...plant import Plant
from ..lab import BESIDE_MODEL, Information, Lab, Method, check_count, check_least, tuned
from ._fixed import linearised


@dataclass(frozen=True)
class WeightSearch(Method):
    """A model is identified once, and what the study's MPC assumes and weighs is tuned by flights.

    Neumann-Brosig, Marco, Schwarzmann, Trimpe, "Data-efficient autotuning with Bayesian optimization: an industrial
    control study", IEEE Trans. Control Systems Technology 28(3), 2020 (arXiv 1812.06325), for an MPC. Beyond the paper
    the model may be fitted to a few flights of the untuned controller, too: identification for control, where what
    matters is how the robot answers along the task (Gevers, "Identification for control: from the early achievements to
    the revival of experiment design", European J. Control 11, 2005).

    Parameters
    ----------
    model
        ``"subspace"``, from a probing record, see :func:`socasadi.model.subspace`; ``"linearised"``, the rod that is
        known about rest, without a record.
    probing
        s of probing.
    flights
        Of the untuned controller, to whose records the model from the probing record is fitted as well.
    kind
        ``"bayesian"``; ``"sobol"`` and ``"random"`` are points that learn nothing.
    tuned
        Settings that theta holds, as of :class:`LinearMPC`.
    over, by
        Other robots on which every controller is flown beside the study's, and whether the mean or the worst J counts:
        a search for robustness, whose flights cost as many times the robot's time.
    most
        Trials, at most; None: as many as there is time for.

    Raises
    ------
    ValueError
        A setting is unknown or out of its range, or the linearised rod is to be fitted to flights: without a probing
        record they do not tell all gains.
    """

    model: Literal["subspace", "linearised"] = "subspace"
    probing: float = 40.0
    flights: int = 0
    kind: Literal["bayesian", "sobol", "random"] = "bayesian"
    tuned: tuple = BESIDE_MODEL
    over: tuple[Callable[[Plant], Plant], ...] = ()
    by: Literal["mean", "worst"] = "mean"
    most: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count(0, flights=self.flights)
        if self.model == "subspace":
            check_least(1, probing=self.probing)
        if self.most is not None:
            check_count(1, most=self.most)
        if not isinstance(self.over, tuple):
            raise TypeError(f"over is a tuple of functions that make another robot of a plant, not {self.over!r}")
        if strange := [other for other in self.over if not callable(other)]:
            raise TypeError(
                f"over holds functions that make another robot of a plant, such as Softer, not {strange[0]!r}"
            )
        if self.flights and self.model == "linearised":
            raise ValueError(
                f"flights={self.flights}: the linearised rod takes 0, only a probed model is fitted to them"
            )

    @property
    def information(self) -> Information:
        return "plant model" if self.model == "linearised" else "other robots" if self.over else "data sheet"

    def offers(self, lab: Lab) -> Iterator[Pilot]:
        if self.model == "linearised":
            model = linearised(lab)
        else:
            record = lab.probe(self.probing)
            model = subspace(record)
            yield (untuned := lab.study.mpc.controller_for(model))
            if self.flights:
                model = subspace(record, flights=lab.records(untuned, self.flights))
        yield from self._tuned(lab, model)

    def _tuned(self, lab: Lab, model: StateSpace) -> Iterator[Pilot]:
        mpc = lab.study.mpc
        searched = replace(mpc, model=Fixed.of(model, mpc.sample_time), tuned=self.tuned)
        return tuned(
            lab,
            searched.entries,
            searched.controller,
            kind=self.kind,
            initial=[searched.whole(())],
            over=self.over,
            by=self.by,
            most=float("inf") if self.most is None else self.most,
        )
