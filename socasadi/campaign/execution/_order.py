"""A trial flown by another process: what is sent there and back is text, and nothing of it is pickled here.

An order is a JSON object: ``settings`` of the study, ``script`` that defines it (null when the settings are enough),
and the ``trial``'s number, theta and threshold (null to make the study only). The answer is a JSON object with the
trial's ``episode`` (packed, in base64), ``failed`` and ``seconds``; or with ``refused``, why that process cannot fly
this study.
"""

import base64
import json
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...plant import ExternalPlant
from ..store import Asked, ForeignTypeError, RunError, differences, pack, rebuild, unpack
from ._flight import Flown, fly_trial
from ._script import load_study

if TYPE_CHECKING:
    from .._study import Study


class _Here(threading.local):
    """The study of the last order, for each thread its own, because a plant does one experiment at a time."""

    key: tuple[str, str | None] | None = None
    study: "Study | None" = None
    making = False


_here = _Here()


def script_of(study: "Study", script: Path | None) -> str | None:
    """The script that another process needs to make ``study``; None when its settings are enough.

    Raises
    ------
    RunError
        It needs one, and none is known.
    """
    if _makes(study.settings):
        return None
    main = getattr(sys.modules["__main__"], "__file__", None)
    script = script or (Path(main) if main else None)
    if script is None or not script.is_file():
        raise RunError(
            "only a script can make a part of this study, and other processes have none to run: put the study into a "
            "file, and start that"
        )
    return str(script.resolve())


def check_not_ordered() -> None:
    """RunError in a script that is run only to make its study for another process."""
    if _here.making:
        raise RunError("it runs its study when it is loaded: put that under `if __name__ == '__main__':`")


def write_order(study: "Study", script: str | None, asked: Asked | None) -> str:
    """The order to fly ``asked``; None to make the study only."""
    trial = asked and {"number": asked.number, "theta": asked.theta.tolist(), "give_up": asked.give_up}
    return json.dumps({"settings": study.settings, "script": script, "trial": trial})


def fly_order(order: str) -> str:
    """Do what ``order`` says, in whatever process and thread, and answer."""
    data = json.loads(order)
    try:
        study = _study(data["settings"], data["script"])
        if data["trial"] is None:
            return json.dumps({})
        flown = fly_trial(study, **data["trial"])
    except Exception as error:
        return json.dumps({"refused": f"{type(error).__name__}: {error}"})
    episode = None if flown.episode is None else base64.b64encode(pack(flown.episode)).decode()
    return json.dumps({"episode": episode, "failed": flown.failed, "seconds": flown.seconds})


def read_answer(answer: str) -> Flown:
    """What an order's trial gave; RunError when its process cannot fly this study."""
    data = check_answer(answer)
    episode = None if data["episode"] is None else unpack(base64.b64decode(data["episode"]))
    return Flown(episode, data["failed"], data["seconds"])


def check_answer(answer: str) -> dict[str, Any]:
    """The data of an answer; RunError when its process cannot fly this study."""
    data = json.loads(answer)
    if "refused" in data:
        raise RunError(f"another process cannot fly this study: {data['refused']}")
    return data


def _study(settings: dict[str, Any], script: str | None) -> "Study":
    key = json.dumps(settings), script
    if _here.study is None or _here.key != key:
        _here.making = True
        try:
            study = _made(settings, script)
            if prepare := getattr(study.plant, "prepare", None):
                prepare()
        finally:
            _here.making = False
        _here.study, _here.key = study, key
    return _here.study


def _made(settings: dict[str, Any], script: str | None) -> "Study":
    from .._study import Study

    if script is None:
        study = Study.from_settings(settings)
    else:
        study = load_study(Path(script))
        # What a command's options change, such as the seed or the start points, is numbers or text.
        plain = [name for name, value in vars(study).items() if _plain(value)]
        study = replace(study, **{name: rebuild(settings[name]) for name in plain})
    if changed := differences(settings, study.settings):
        raise RunError(f"{script or 'socasadi'} makes another study there: {'; '.join(changed)}")
    return study


def _makes(settings: dict[str, Any]) -> bool:
    """Whether the settings alone make the study, with a robot that can be flown."""
    from .._study import Study

    try:
        return not isinstance(Study.from_settings(settings).plant, ExternalPlant)
    except ForeignTypeError:
        return False


def _plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(_plain(item) for item in value)
    return value is None or isinstance(value, bool | int | float | str)
