"""Why a transmission did not arrive, in words a user can act on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, unique

__all__ = ["Cause", "Verdict"]


@unique
class Cause(Enum):
    """What a receiver can tell apart; the text names it."""

    NONE = "received whole"
    DARK = "no light of a panel"
    OUT_OF_VIEW = "the panel is out of view"
    OCCLUDED = "part of the panel is hidden"
    OUT_OF_FOCUS = "the panel is out of focus"
    SATURATED = "the sensor is saturated"
    DIM = "the panel is too dim for the threshold"
    WRONG_CLOCK = "the panel's clock is off"
    INTERRUPTED = "the transmission breaks off and goes on elsewhere"
    TRUNCATED = "the stream ends too early"
    TOO_LARGE = "the file is larger than the run can carry"
    TOO_SMALL = "the panel's cells are too small in the image"
    NOISY = "too many errors"


@dataclass(frozen=True)
class Verdict:
    """cause: the main one. told: a sentence with the figures that show it and what mends it."""

    cause: Cause
    told: str

    @property
    def whole(self) -> bool:
        return self.cause is Cause.NONE
