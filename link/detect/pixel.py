"""Known properties of the sensor's pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Rule = Literal["hard", "residual"]


@dataclass(frozen=True)
class PixelLaw:
    """Known properties of a pixel; None for those that must be learned.

    Attributes:
        threshold: electrons.
        reset: reset rule.
        off, on: charge of a tick in a cell that is off or on, thresholds; `on` includes the light
            of `off`.
        noise: standard deviation of a tick's charge beyond shot noise, electrons.
    """

    threshold: float = 1000.0
    reset: Rule | None = None
    off: float | None = None
    on: float | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        if not self.threshold > 0:
            raise ValueError(f"threshold must be above 0 e, not {self.threshold:g} e")
        if self.off is not None and self.on is not None and not 0 <= self.off < self.on:
            raise ValueError(f"off must be from 0 to below on, not {self.off:g} and {self.on:g}")
