from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal, get_args, get_origin

from threadpoolctl import threadpool_limits

from ...campaign import Pilot
from ._lab import BudgetSpent, Lab
from ._settings import check_least

Information = Literal["data sheet", "other robots", "plant model"]


@dataclass(frozen=True)
class Method(ABC):
    """A way to get a controller for a robot of which nothing is known but its data sheet and what it shows.

    One of one's own is a frozen dataclass that inherits this one and defines :meth:`offers`.

    Raises
    ------
    ValueError
        A setting whose type is a ``Literal`` is none of its values.
    """

    def __post_init__(self) -> None:
        for setting in fields(self):
            value, known = getattr(self, setting.name), get_args(setting.type)
            if get_origin(setting.type) is Literal and value not in known:
                raise ValueError(f"unknown {setting.name} {value!r}; there are {', '.join(map(str, known))}")

    @property
    def information(self) -> Information:
        """What it is lent or told beside the robot and its data sheet.

        ``"other robots"`` if it flies on some, ``"plant model"`` if it reads the parameters of :attr:`Lab.known`.
        """
        return "data sheet"

    @abstractmethod
    def offers(self, lab: Lab) -> Iterator[Pilot]:
        """Spend the lab's time, and yield a new controller whenever there is a better one than that before.

        What counts at a checkpoint is the last controller before it. The lab ends it all by :class:`BudgetSpent`, which
        is not to be caught.
        """

    def controller(self, lab: Lab) -> Pilot:
        """The last controller that it offers within the lab's time.

        Raises
        ------
        BudgetSpent
            There is none: the time is too short.
        """
        offered: list[Pilot] = []
        why = "its time was enough for all that it does"
        try:
            with threadpool_limits(1):  # its matrices are small: threads would wait for each other
                offered.extend(offers_of(self, lab))
        except BudgetSpent as error:
            why = str(error)
        if not offered:
            why = lab.failures or why
            raise BudgetSpent(f"{type(self).__name__} has no controller to offer: {why}")
        return offered[-1]


@dataclass(frozen=True)
class Probed(Method):
    """A method that begins with a probing record.

    Parameters
    ----------
    probing
        s of probing.
    """

    probing: float = 40.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_least(1, probing=self.probing)


def offers_of(method: Method, lab: Lab) -> Iterator[Pilot]:
    """What a method offers; TypeError if its ``offers`` is no generator."""
    offered = method.offers(lab)
    if not isinstance(offered, Iterator):
        raise TypeError(
            f"offers of {type(method).__name__} returned {type(offered).__name__}: let it yield controllers, "
            "or return an iterator of them, such as tuned(...)"
        )
    return offered
