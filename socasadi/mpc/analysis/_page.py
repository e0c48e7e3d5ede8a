"""An analysis as a page of text."""

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from ._observability import OBSERVABLE

if TYPE_CHECKING:
    from ._analysis import Analysis


def page(of: "Analysis") -> str:
    """What a control engineer reads first, about 120 characters wide."""
    plant = "prediction model" if of.on_model else "plant given"
    lines = [
        f"MPC on the {plant} while no bound is active, sampled every {1e3 * of.sample_time:.4g} ms: "
        + ("STABLE" if of.stable else "UNSTABLE"),
        *_poles(of),
        *(_gains(of) if of.stable else [_line("worst-case gains", "infinite: the loop does not come to rest")]),
        _line("observability", _observability(of)),
    ]
    for title, sentences in (("Established", of.established), ("Not established", of.not_established)):
        lines.append(title)
        for sentence in sentences:
            lines += textwrap.wrap(sentence, 118, initial_indent="  - ", subsequent_indent="    ")
    return "\n".join(lines)


def _line(name: str, told: str) -> str:
    return f"  {name:<22}{told}"


def _poles(of: "Analysis") -> list[str]:
    lines = [f"  {'poles of the':<22}{'number':>6}{'radius':>10}{'slowest':>11}     least damping"]
    model = "" if of.on_model else " (model)"
    for name, poles in {f"regulator{model}": of.regulator, f"observer{model}": of.observer, "loop": of.loop}.items():
        damping, frequency = poles.least_damped
        damped = "none oscillates" if np.isnan(frequency) else f"{damping:.3f} at {frequency:.3g} Hz"
        lines.append(
            f"    {name:<20}{len(poles.values):>6}{poles.radius:>10.4f}{poles.time_constant:>9.3g} s     {damped}"
        )
    if of.output_time_constant < 0.999 * of.loop.time_constant:
        lines.append(f"    {'of which y shows':<36}{of.output_time_constant:>9.3g} s")
    return lines


def _gains(of: "Analysis") -> list[str]:
    peaks = {
        "disturbance of y -> y": (of.sensitivity, f"{of.sensitivity.gain:.3f}"),
        "noise -> y": (of.complementary, f"{of.complementary.gain:.3f}"),
        "noise -> input": (of.noise_to_input, f"{1e-3 * of.noise_to_input.gain:.3g} u_max/mm"),
    }
    lowest, highest = of.gain_margin
    largest = "any" if np.isinf(highest) else f"{highest:.3g}"
    return [
        "  worst-case gains",
        *(f"    {name:<24}{gain:<16} at {peak.frequency:.3g} Hz" for name, (peak, gain) in peaks.items()),
        _line(
            "stable under",
            f"error of y below {100 * of.robust_error:.3g} % (small gain); plant's gain x {lowest:.3g} to {largest}",
        ),
        _line("at rest", _at_rest(of)),
    ]


def _at_rest(of: "Analysis") -> str:
    if of.offset_free:
        return "offset-free: y = reference whatever constant disturbance acts (integral action)"
    missed = np.abs(of.reference_gain - np.eye(len(of.reference_gain))).max()
    left = np.abs(of.output_disturbance_gain).max()
    action = "integral action" if of.integral_action else "no integral action"
    return f"{action}: {100 * missed:.3g} % of a reference missed, {100 * left:.3g} % of a disturbance of y left"


def _observability(of: "Analysis") -> str:
    told = (
        f"{_measure(of.observability)} with disturbances, {_measure(of.observability_model)} without (0 none, 1 best)"
    )
    if not of.unstable_modes:
        return f"{told}; no unstable modes"
    counted = "1 unstable mode" if of.unstable_modes == 1 else f"{of.unstable_modes} unstable modes"
    return f"{told}; {counted}, controllable: {_measure(of.stabilisability)}"


def _measure(value: float) -> str:
    return f"{value:.2g}" if value > OBSERVABLE else "NONE"
