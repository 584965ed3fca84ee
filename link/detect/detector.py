"""What a detector is, and which there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words
from link.layout import Layout
from link.timing import Registration, Timing

if TYPE_CHECKING:
    from link.detect.pixel import PixelLaw

__all__ = ["DETECTORS", "Bits", "Detector", "DetectorName", "Soft", "bits_held", "make_detector"]

DetectorName = Literal["joint", "threshold", "forward-backward"]
DETECTORS: tuple[DetectorName, ...] = ("joint", "threshold", "forward-backward")
Bits = npt.NDArray[np.bool_]
"""(symbols, cells) of data cells."""
Soft = npt.NDArray[np.float32]
"""(symbols, cells): ln P(spikes | on) - ln P(spikes | off)."""


def bits_held(words: Words, start_tick: int, stop_tick: int | None) -> int:
    """Bits of words, counted from start_tick, that are of the stream."""
    every = len(words) * WORD
    return every if stop_tick is None else min(max(stop_tick - start_tick, 0), every)


class Detector(Protocol):
    """Spikes to soft values of the data cells.

    words: (n, H, W) uint32, bit 0 of word 0 being tick start_tick. Symbols are numbered from first
    light; the first one's time is the timing's `first`. stop_tick: the stream's end where it lies
    within the last word: nothing from there on is read. A symbol that the words do not hold at all
    gets 0. `learn` may be called again and adds what it sees; `learn_pilots` does so from the pilot
    cells, for symbols first_symbol to first_symbol + count, where the training was missed.
    """

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None: ...
    def learn_pilots(
        self, words: Words, start_tick: int, first_symbol: int, count: int
    ) -> None: ...
    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft: ...  # fmt: skip


def make_detector(
    name: DetectorName,
    layout: Layout,
    registration: Registration,
    timing: Timing,
    *,
    pixel: PixelLaw | None = None,
) -> Detector:
    """A detector by its name. pixel: what is known of the sensor's pixels, for forward-backward;
    it learns their light, and their reset rule unless it is given."""
    if name == "joint":
        from link.detect.joint import Joint

        return Joint(layout, registration, timing)
    if name == "threshold":
        from link.detect.threshold import Threshold

        return Threshold(layout, registration, timing)
    if name == "forward-backward":
        from link.detect.forward_backward import ForwardBackward

        return ForwardBackward(layout, registration, timing, pixel)
    raise ValueError(f"detector must be one of {', '.join(DETECTORS)}, not {name}")
