"""The judge of an imager's controller: what it decided on a frame, whether what is left out could
reach a threshold of the decision, and what full physics decides."""

from __future__ import annotations

from typing import Any, Protocol

from scipy.special import ndtri

from cosim.frames import Frame
from cosim.plan.paired import CONFIDENCE
from sensor.imagers import Exposed, PixelModel

__all__ = ["Judge", "JudgeBase", "deviations"]


class Judge(Protocol):
    """Knows the decisions of one imager's controller; it is asked after each frame."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether an exposure depends on this frame. It is called for every frame."""
        ...

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether what is left out could reach a threshold of the decision."""
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
    """Standard deviations that none of so many normal numbers exceeds, at 99.9 %."""
    return -float(ndtri((1 - CONFIDENCE) / 2 / max(among, 1)))


class JudgeBase:
    """What a judge knows.

    Args:
        imager: that films.
        full, kept: all effects, and those that the run keeps.
        seed: of the temporal noise.
    """

    def __init__(self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> None:
        self._imager, self._full, self._kept, self._seed = imager, full, kept, seed
