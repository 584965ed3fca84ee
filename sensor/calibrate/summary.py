"""The summary on the page of a calibration."""

from __future__ import annotations

from typing import Final

from cosim.config.amounts import count, elapsed, percent
from cosim.report.parts import Card, cards
from cosim.report.summary import Answer, big, listed, paragraph
from sensor.calibrate.calibration import Calibration

_MAIN: Final = ("interval_noise", "threshold", "prnu", "dark_current", "dead_time")
"""Parameters with a card of their own, if they are known."""
_ROLES: Final = {
    "flat": "constant uniform light", "scene": "a scene at rest", "moving": "changing light",
    "dark": "darkness", "saturated": "light too bright to be used",
}  # fmt: skip


def answers(result: Calibration, seconds: float) -> list[Answer]:
    """The answers for a newcomer. seconds: that the calibration took."""
    used = listed(f"{name}: {_ROLES[role]}" for name, role in result.roles.items())
    done = (
        "The parameters of the pixel's model were estimated from spikes alone, with limits that "
        "hold the true value with 95 % confidence. The recordings show:"
    )
    return [
        ("What was calibrated", paragraph(done) + used),
        ("How well the camera is known", cards(_cards(result))),
        ("How wrong it may be", _wrong(result)),
        ("How long it took", big(elapsed(seconds), "Reading and fits.")),
        ("What was left out", _left_out(result)),
        ("Notes", listed(result.notes)),
    ]


def _cards(result: Calibration) -> list[Card]:
    found = result.parameters
    known = sum(p.known for p in found.values())
    rows: list[Card] = [("first", f"{count(known)} of {count(len(found))}", "parameters are known")]
    for name in _MAIN:
        if name in found and found[name].known:
            value, _, limits = found[name].text.partition(", ")
            rows.append(("", value, found[name].title + (f" ({limits})" if limits else "")))
    return rows


def _wrong(result: Calibration) -> str:
    limits = "The limits of each parameter are in the tables. "
    if not result.histograms:
        return paragraph(limits + (
            "No recording is of constant light, so the model could not be compared with one."
        ))  # fmt: skip
    off = max(histogram.off for histogram in result.histograms)
    text = (
        "of the intervals of a recording are longer or shorter than in the model with these "
        "parameters, in the recording where it fits worst. " + limits
    )
    if result.does_not_fit:
        text += "Beyond chance, the model does not explain: "
    else:
        text += "All deviations are within chance."
    return big(percent(off, 2), text.strip()) + listed(result.does_not_fit)


def _left_out(result: Calibration) -> str:
    unknown = [p.title for p in result.parameters.values() if not p.known]
    bright = [name for name, role in result.roles.items() if role == "saturated"]
    text = "Nothing: every parameter is known."
    if unknown:
        text = (
            f"What these recordings cannot tell: {'; '.join(unknown)}. A table says why, and what "
            "would make each known."
        )
    if bright:
        text += f" Recordings too bright to be used: {', '.join(bright)}."
    return paragraph(text)
