from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ...campaign import Study, Task
from ...plant import Plant
from ..lab import Method, check_lent

if TYPE_CHECKING:
    from ._comparison import Comparison


def check_comparison(comparison: "Comparison") -> None:
    """Raises what :class:`Comparison` says of its settings."""
    if not isinstance(comparison.study, Study):
        raise TypeError(f"study is a Study, not {comparison.study!r}")
    for what, named, kinds in (("task", comparison.tasks, Task | Study), ("method", comparison.methods, Method)):
        if not isinstance(named, Mapping) or not named:
            raise TypeError(f"{what}s are a dictionary, at least one {what} by its name, not {named!r}")
        for name, value in named.items():
            if not isinstance(value, kinds):
                raise TypeError(
                    f"{value!r} is given as the {what} {name!r}; an instance of {what.capitalize()} is needed"
                )
    for name in comparison.tasks:
        if not isinstance(name, str) or not name or set(name) & set("/\\"):
            raise ValueError(f"the task {name!r} gives files their names: it is not empty and without slashes")
    for what in ("seeds", "checkpoints"):
        numbers, least = getattr(comparison, what), 0 if what == "seeds" else 1
        if isinstance(numbers, str) or not isinstance(numbers, Sequence) or not numbers:
            raise TypeError(f"{what} are several whole numbers, not {numbers!r}")
        if any(not isinstance(n, int) or n < least for n in numbers) or len(set(numbers)) < len(numbers):
            raise ValueError(f"{what} are different whole numbers from {least} on, not {list(numbers)}")
    if list(comparison.checkpoints) != sorted(comparison.checkpoints):
        raise ValueError(f"checkpoints are numbers of episodes that ascend, not {list(comparison.checkpoints)}")
    if not isinstance(comparison.flights, int) or comparison.flights < 1:
        raise ValueError(f"flights are at least 1 of each controller, not {comparison.flights!r}")
    check_lent(comparison.study)
    for given in comparison.tasks.values():
        if isinstance(given, Study):
            check_lent(given)
    if not isinstance(comparison.elsewhere, Mapping):
        raise TypeError(f"elsewhere is a dictionary, other robots by name, not {comparison.elsewhere!r}")
    for name, other in comparison.elsewhere.items():
        if not callable(other):
            raise TypeError(f"elsewhere holds functions that make another robot of a plant; {name!r} is {other!r}")
    for what, kind, known in (("elsewhere_on", "task", comparison.tasks), ("shown", "method", comparison.methods)):
        names = getattr(comparison, what)
        if isinstance(names, str) or not isinstance(names, Sequence):
            raise TypeError(f"{what} are names of {kind}s, not {names!r}")
        if unknown := [name for name in names if name not in known]:
            raise ValueError(f"{what} names {unknown[0]!r}; the {kind}s are {', '.join(known)}")
    if comparison.elsewhere and not comparison.elsewhere_on:
        raise ValueError("elsewhere has robots, but elsewhere_on no task: name those whose controllers fly on them")


def check_elsewhere(comparison: "Comparison") -> None:
    """Raises ValueError if another robot cannot be made of one that it is to stand beside."""
    for task in comparison.elsewhere_on:
        plant = comparison.of(task, comparison.seeds[0]).plant
        for name, other in comparison.elsewhere.items():
            try:
                made = other(plant)
            except Exception as error:
                raise ValueError(f"elsewhere: no {name!r} of the robot of the task {task!r}: {error}") from error
            if not isinstance(made, Plant):
                raise ValueError(f"elsewhere: {name!r} of the robot of the task {task!r} is no plant, but {made!r}")
