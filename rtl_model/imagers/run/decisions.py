"""Whether what a plan leaves out changes a decision of the imager's own controller.

The paired check (`paired`) converts a run's exposures in both ways, so it sees what leaving out
does to values, not to the exposures that follow from them. Here every frame's decision is looked
at: how far may what is left out move the statistic that it was made from, and does that reach a
limit of the decision? How far is measured on strips of the frame, converted with everything and as
planned, with the same random numbers (`judges`). Where a limit is within reach, the check's own
controller decides for itself: the whole frame is converted with everything, and the decision made
anew. All decisions before were alike, so what it finds is what full physics would have done. From
the first that differs on, the two runs are of different exposures: the change of the pixel values
that the one decision makes is the run's error, if that is not larger, and no more is looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from cosim.frames import Frame
from rtl_model.imagers.run.judges import Judge, judge_of
from rtl_model.imagers.run.paired import cut_rows, strips
from sensor.imagers import Exposed, PixelModel

__all__ = ["Decided", "Decisions"]


@dataclass(frozen=True)
class Decided:
    """looked: frames whose decision was looked at. close: of these, with a limit within reach of
    what is left out. flipped: number of the first frame on which full physics decides otherwise;
    None for none. change: relative, of the mean of a pixel value that this makes; 0 for none."""

    looked: int
    close: int
    flipped: int | None
    change: float

    def told(self) -> str:
        """In words."""
        if self.flipped is not None:
            return (
                f"full physics decides otherwise on frame {self.flipped} what exposure follows: "
                f"the change of the pixel values that this makes, {self.change:.2g}, is counted"
            )
        if self.close:
            return (
                f"{self.close} of {self.looked} decisions of its controller were within reach of "
                "what was left out, and full physics decides each alike"
            )
        return f"no decision of its controller could turn out otherwise ({self.looked} looked at)"


class Decisions:
    """Of one run. imager: that films. full, kept: all effects, and those that the run keeps. Has
    nothing to say of an imager without a controller."""

    def __init__(self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> None:
        self._judge: Judge | None = judge_of(imager, full, kept, seed) if full - kept else None
        self._seen: tuple[Exposed, PixelModel] | None = None
        self._full, self._seed = full, seed
        self._looked = self._close = 0
        self._flipped: int | None = None
        self._change = 0.0

    def see(self, rows: Exposed, pixels: PixelModel) -> None:
        """Rows have been converted; their frame's decision comes next."""
        if self._judge is not None:
            self._seen = rows, pixels

    def frame(self, frame: Frame) -> None:
        """The frame that was made of them has been decided on."""
        if self._judge is None or self._seen is None or self._flipped is not None:
            return
        (rows, pixels), judge = self._seen, self._judge
        if not judge.decides(rows, pixels, frame):
            return
        self._looked += 1
        if not judge.close(rows, pixels, frame):
            return
        self._close += 1
        here, other = judge.chosen(frame), judge.in_full(rows, pixels)
        if here != other:
            self._flipped = frame.number
            now = judge.exposure(frame)
            self._change = self._between(rows, pixels, here / now, other / now)

    def _between(self, rows: Exposed, pixels: PixelModel, here: float, other: float) -> float:
        """Relative change of the mean pixel value of a strip, the largest, between exposures of
        these multiples of the frame's own, under its light, with everything."""
        worst = 0.0
        for at in strips(rows):
            cut = cut_rows(rows, at)
            means = [
                float(
                    pixels.convert(
                        replace(
                            cut, lux_seconds=cut.lux_seconds * factor, seconds=cut.seconds * factor
                        ),
                        self._seed, self._full,
                    ).mean()
                )
                for factor in (here, other)
            ]  # fmt: skip
            worst = max(worst, abs(means[0] - means[1]) / max(means[1], 1.0))
        return worst

    def decided(self) -> Decided | None:
        """What was found; None where nothing is decided or left out."""
        if self._judge is None:
            return None
        return Decided(self._looked, self._close, self._flipped, self._change)
