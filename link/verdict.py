"""Causes of a failed transmission, in words that a user can act on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, unique


@unique
class Cause(Enum):
    """What a receiver can distinguish; the text names it."""

    NONE = "received whole"
    DARK = "no light of a panel"
    OUT_OF_VIEW = "the panel is out of view"
    MIRRORED = "the image is mirrored"
    OCCLUDED = "part of the panel is hidden"
    OUT_OF_FOCUS = "the panel is out of focus"
    SATURATED = "the sensor is saturated"
    DIM = "the panel is too dim for the threshold"
    WRONG_CLOCK = "the panel's clock is off"
    INTERRUPTED = "the stream or the light was interrupted"
    TRUNCATED = "the stream ends too early"
    TOO_LARGE = "the file is larger than the run can carry"
    TOO_SMALL = "the panel's cells are too small in the image"
    NOISY = "too many errors"


@dataclass(frozen=True)
class Verdict:
    """Why a file did not arrive.

    Attributes:
        cause: the main one.
        text: a sentence with the supporting figures, and a remedy.
    """

    cause: Cause
    text: str

    @property
    def whole(self) -> bool:
        return self.cause is Cause.NONE
