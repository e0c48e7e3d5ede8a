"""What the found theta is worth: as a controller without the luck of its trial, and as a model."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model import identify, state_space_error
from ..mpc import DesignError
from ..plant import ExternalPlant
from ._result import Result
from .execution import Stream, drawn_seed, flown_cost, fly_once
from .experiment import Episode, probe
from .store import Flight, Journal, journal_path

if TYPE_CHECKING:
    from ._study import Study


@dataclass(frozen=True, eq=False)
class Verdict:
    """One theta under fresh noise, and as a model.

    Attributes
    ----------
    theta
        (size,).
    J, rmse
        (verifications,) of the flights that did not fail; rmse in m.
    failed, broken
        Numbers of flights that failed, and of those that broke a limit of the study.
    prediction_error
        Open-loop root mean square distance on a probing record that it was not fitted to, m; NaN without one.
    """

    theta: np.ndarray
    J: np.ndarray
    rmse: np.ndarray
    failed: int
    broken: int
    prediction_error: float


@dataclass(frozen=True, eq=False)
class Assessment:
    """Thetas beside each other.

    Attributes
    ----------
    verdicts
        By name: ``"best"``, the best observed; ``"best estimated"``, that of the search, when it is another; the
        rivals; ``"identified"``.
    unidentified
        Why there is no identified theta; None when there is one.
    """

    verdicts: dict[str, Verdict]
    unidentified: str | None = None


def assess(
    result: Result, rivals: Mapping[str, np.ndarray] | None = None, notify: Callable[[str], None] = lambda _: None
) -> Assessment:
    """Fly the best thetas, ``rivals`` and an identified theta under the same fresh noise, and compare them as models.

    The best observed theta owes a part of its J to the noise of its trial, so the best that the search estimates is
    flown beside it; what is exported is the better of the two here (:attr:`Result.chosen`).

    Experiments: two probing records (one to identify from, one to judge all on) and ``study.verifications`` flights of
    each theta. They are stored in the journal as they happen, so that none is flown twice.

    Parameters
    ----------
    rivals
        Further thetas by name.
    notify
        Is told what is being done.

    Returns
    -------
    Assessment
        Without verdicts when the study asks for no verifications.

    Raises
    ------
    ExternalPlantError
        The robot cannot be flown from here.
    """
    study = result.study
    if study.verifications == 0:
        return Assessment({}, "the study asks for no verifications")
    if isinstance(study.plant, ExternalPlant):
        study.plant.prepare()  # refuses: what cannot be flown is no failure of a theta
    thetas, judged, unidentified = {"best": result.best.theta}, None, None
    estimate = result.best_estimated
    if estimate is not None and not np.array_equal(estimate.theta, result.best.theta):
        thetas["best estimated"] = estimate.theta
    thetas |= rivals or {}
    with Journal(journal_path(result.folder), writer=True) as journal:
        try:
            if study.mpc.measured_disturbances:
                raise ValueError("a probing record does not hold the disturbances that are measured")
            notify("probing the plant")
            fitted, judged = (_probing(result, journal, index) for index in (1, 2))
            notify("identifying a model")
            thetas["identified"] = study.mpc.whole(identify(study.mpc.model, fitted.record))
        except Exception as error:  # as in a trial: whatever the plant raises, the run goes on
            unidentified = f"{type(error).__name__}: {error}"
        verdicts = {}
        for name, theta in thetas.items():
            notify(f"flying {name} {study.verifications} times")
            flights = [_verification(result, journal, name, i, theta) for i in range(1, study.verifications + 1)]
            verdicts[name] = _verdict(study, theta, flights, judged)
    return Assessment(verdicts, unidentified)


def assessed(result: Result) -> dict[str, Verdict]:
    """What was flown beside the search so far, by theta: ``"trial 12"``, or its name where it is of no trial.

    Of thetas without a trial that went by one name, the one flown last. Flies nothing.
    """
    known = result.flights()
    judged = known["probe 2"].episode if "probe 2" in known else None
    names = {trial.theta.tobytes(): f"trial {trial.number}" for trial in result.trials}
    flights: dict[bytes, dict[str, Flight]] = {}
    for flight in known.values():
        if flight.theta is not None:
            name, _, index = flight.name.rsplit(" ", 2)
            names.setdefault(flight.theta.tobytes(), name)
            # Under another name it was flown with the same noise.
            flights.setdefault(flight.theta.tobytes(), {})[index] = flight
    return {
        names[theta]: _verdict(result.study, np.frombuffer(theta), [*flown.values()], judged)
        for theta, flown in flights.items()
    }


def _verdict(study: Study, theta: np.ndarray, flights: Sequence[Flight | None], judged: Episode | None) -> Verdict:
    flown = [flight for flight in flights if flight is not None and flight.score is not None]
    scores = [flight.score for flight in flown if flight.score is not None]
    return Verdict(
        theta,
        J=np.array([score.J for score in scores]),
        rmse=np.array([score.rmse for score in scores]),
        failed=len(flights) - len(scores),
        broken=sum(np.isinf(flown_cost(flight, study)) for flight in flown),
        prediction_error=state_space_error(study.mpc.system(theta), judged.record) if judged else np.nan,
    )


def _probing(result: Result, journal: Journal, index: int) -> Episode:
    name = f"probe {index}"
    if name not in (known := journal.flights()):
        study = result.study
        seed = drawn_seed(study.seed, Stream.PROBE, index)
        record = probe(study.plant, study.mpc.input_bounds, seed=seed)
        nothing = np.zeros_like(record.output)
        episode = Episode(
            sample_time=record.sample_time,
            output=record.output,
            reference=nothing,
            truth=record.output,
            tension=record.tension,
            held=record.tension[0],
            shapes=np.zeros((0, 0, 3)),
        )
        journal.add_flight(Flight(name, None, None, episode))
        return episode
    return known[name].episode


def _verification(result: Result, journal: Journal, name: str, index: int, theta: np.ndarray) -> Flight | None:
    """Flight ``index`` of ``theta``, flown unless the journal has it; None when theta gives no controller."""
    study = result.study
    # The hash keeps apart what goes by one name at different times, such as the best of a run that went on.
    name = f"{name} {hashlib.sha256(theta.tobytes()).hexdigest()[:8]} {index}"
    if (known := journal.flights().get(name)) is not None:
        return known
    try:
        controller = study.mpc.controller(theta)
    except DesignError:
        return None
    episode = fly_once(study, controller, (Stream.VERIFICATION, index))
    score = study.cost.score(episode, study.mpc.input_scale) if episode.failure is None else None
    flight = Flight(name, theta, score, episode)
    journal.add_flight(flight)
    return flight
