"""The costs of a run's trials as a line of text."""

from collections.abc import Callable
from math import ceil, log

from .campaign import Trial

_BLOCKS, _PLAIN = "▁▂▃▄▅▆▇█", ".:-=+*#"
# What stands for a trial without a cost that counts.
_SIGNS = {"!": "broke a limit", ">": "cut", "x": "failed"}
_WIDEST = 120

# Costs above this multiple of the least are not told apart.
_HIGHEST = 30


def sparkline(trials: list[Trial], kept: Callable[[Trial], bool], width: int, encoding: str) -> list[str]:
    """Lines that show J over the trials by number: what the signs mean, the signs, and where the best is.

    Only the costs of trials that are ``kept`` count. Where there are more trials than columns in ``width``, several
    share one, which shows the best of them. No lines where there are no trials.

    Parameters
    ----------
    encoding
        Of what the lines are printed to; where it has no blocks, they are ASCII.
    """

    def rank(trial: Trial) -> tuple[int, float]:
        return (0, trial.J or 0.0) if kept(trial) else (1 + list(_SIGNS).index(_sign(trial)), 0.0)

    if not trials:
        return []
    ordered = sorted(trials, key=lambda trial: trial.number)
    share = ceil(len(ordered) / min(width, _WIDEST))
    shown = [min(ordered[i : i + share], key=rank) for i in range(0, len(ordered), share)]
    block, legend = _scale([trial.J for trial in shown if trial.J is not None and kept(trial)], _known_to(encoding))
    signs = [_sign(trial) for trial in ordered if not kept(trial)]
    legend += [f"{sign} {meaning} ({signs.count(sign)})" for sign, meaning in _SIGNS.items() if sign in signs]
    lines = [
        f"J over the trials{f', of every {share} the best' if share > 1 else ''}: {', '.join(legend)}",
        "".join(block(trial.J or 0.0) if kept(trial) else _sign(trial) for trial in shown),
    ]
    best = min(shown, key=rank)
    return [*lines, _pointer(shown.index(best), f"best: trial {best.number}")] if kept(best) else lines


def _sign(trial: Trial) -> str:
    return {"done": "!", "cut": ">", "failed": "x"}[trial.outcome]


def _known_to(encoding: str) -> str:
    """The blocks, from the least, that can be printed."""
    try:
        _BLOCKS.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        return _PLAIN
    return _BLOCKS


def _scale(costs: list[float], blocks: str) -> tuple[Callable[[float], str], list[str]]:
    """What draws a cost as one of the ``blocks``, and what it says of them."""
    least, most = min(costs, default=0.0), max(costs, default=0.0)
    if least == most:
        return (lambda J: blocks[0]), [f"{blocks[0]} {least:.4g}"] if costs else []
    logarithmic = least > 0  # which a cost that was measured elsewhere need not be
    top = min(most, _HIGHEST * least) if logarithmic else most

    def block(J: float) -> str:
        height = log(J / least) / log(top / least) if logarithmic else (J - least) / (top - least)
        return blocks[min(int(len(blocks) * height), len(blocks) - 1)]

    above = " and above" if most > top else ""
    scale = "log scale" if logarithmic else "linear scale"
    return block, [f"{blocks[0]} {least:.4g} to {blocks[-1]} {top:.4g}{above} ({scale})"]


def _pointer(place: int, text: str) -> str:
    """A mark below a column with a text beside it, on the side where there is room."""
    before = f"{text} ^"
    return f"{before:>{place + 1}}" if len(before) <= place + 1 else f"{'^':>{place + 1}} {text}"
