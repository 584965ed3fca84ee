"""Diagnosis of a panel that is too bright or too dim."""

from __future__ import annotations

from typing import Final

from link.verdict import Cause, Verdict

_DIM: Final = 0.6
"""Rate of the tags' white below which the panel is dim."""
SATURATED: Final = 0.5
"""Share of pixels that fire in every tick, or rate of the tags' black, from which the sensor is
saturated."""


def brightness_verdict(white: float, black: float) -> Verdict | None:
    """Verdict; None if the light is adequate.

    Args:
        white, black: spikes a tick of the white and the black of the tags.
    """
    if black >= SATURATED:
        return Verdict(
            Cause.SATURATED,
            f"black of the panel fires {black:.2f} times a tick; stop the lens down, raise the "
            "threshold, or shade the panel",
        )
    if white < _DIM:
        return Verdict(
            Cause.DIM,
            f"white of the panel fires {white:.2f} times a tick, so symbols are missed; open the "
            "lens, lower the threshold, or show symbols of more ticks",
        )
    return None
