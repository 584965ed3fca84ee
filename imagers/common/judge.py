"""The judge of an imager's controller: its decision on a frame, whether the omitted effects could
change that decision, and the decision under full physics."""

from __future__ import annotations

from typing import Any, Protocol

from scipy.special import ndtri

from cosim.frames import Frame
from cosim.plan.paired import CONFIDENCE
from sensor.frame_pixels import Exposed, PixelModel

__all__ = ["Judge", "JudgeBase", "deviations"]


class Judge(Protocol):
    """Judges the decisions of one imager's controller, frame by frame."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether a later exposure depends on this frame. Called for every frame."""
        ...

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether the omitted effects could move the statistic across a decision threshold."""
        ...

    def chosen(self, frame: Frame) -> int:
        """The exposure that the run has chosen."""
        ...

    def in_full(self, rows: Exposed, pixels: PixelModel) -> int:
        """The exposure that full physics chooses, from the same light and random numbers."""
        ...

    def exposure(self, frame: Frame) -> float:
        """The exposure of the frame itself, in the same unit."""
        ...


def deviations(among: int) -> float:
    """Number of standard deviations that none of `among` normal variates exceeds, at 99.9 %."""
    return -float(ndtri((1 - CONFIDENCE) / 2 / max(among, 1)))


class JudgeBase:
    """Base of the judges.

    Args:
        imager: that films.
        full, kept: names of all effects, and of those that the run keeps.
        seed: seed of the temporal noise.
    """

    def __init__(self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> None:
        self._imager, self._full, self._kept, self._seed = imager, full, kept, seed
