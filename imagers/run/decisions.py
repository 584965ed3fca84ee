"""Whether the effects that a plan omits change a decision of the imager's controller.

The paired check (`paired`) converts the exposures of a run in two ways: with every effect, and as
planned. It measures how the omission changes pixel values, but not how it changes the exposures
that follow from them. This module examines the decision on every frame: how far can the omission
move the statistic of the decision, and does this reach a decision threshold? The shift is measured
on strips of the frame, converted in both ways with the same random numbers (`JudgeBase`). If
a threshold is within reach, the whole frame is converted with every effect and the decision is
repeated. All earlier decisions agreed, so the result is the decision of full physics. At the first
decision that differs, the exposures of the two runs diverge. The resulting change of the pixel
values is then the error of the run, if it exceeds the paired error, and later frames are not
examined.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cosim.frames import Frame
from imagers.common.judge import Judge
from imagers.run.paired import cut_rows, strips
from sensor.frame_pixels import Exposed, PixelModel

__all__ = ["DecisionCheck", "Decisions"]


@dataclass(frozen=True)
class DecisionCheck:
    """The decisions of a run's controller, compared with those of full physics.

    Attributes:
        examined: number of frames whose decision was examined.
        close: number of those with a threshold within reach of the omission.
        differs_at: number of the first frame on which full physics decides otherwise; None if none.
        change: relative change of the mean pixel value caused by that decision; 0 if none.
    """

    examined: int
    close: int
    differs_at: int | None
    change: float

    def text(self) -> str:
        """The result in words."""
        if self.differs_at is not None:
            return (
                f"full physics decides otherwise on frame {self.differs_at} what exposure follows: "
                f"the change of the pixel values that this makes, {self.change:.2g}, is counted"
            )
        if self.close:
            return (
                f"{self.close} of {self.examined} decisions of its controller were within reach of "
                "what was left out, and full physics decides each alike"
            )
        return f"no decision of its controller could turn out otherwise ({self.examined} looked at)"


class Decisions:
    """Examines the decisions of one run, frame by frame.

    Args:
        judge: judge of the imager's controller; None if there is nothing to examine.
        full: names of all effects.
        seed: seed of the temporal noise.
    """

    def __init__(self, judge: Judge | None, full: frozenset[str], seed: int) -> None:
        self._judge = judge
        self._converted: tuple[Exposed, PixelModel] | None = None
        self._full, self._seed = full, seed
        self._examined = self._close = 0
        self._differs_at: int | None = None
        self._change = 0.0

    def add(self, rows: Exposed, pixels: PixelModel) -> None:
        """Stores the rows that were converted last; the decision on their frame follows."""
        if self._judge is not None:
            self._converted = rows, pixels

    def frame(self, frame: Frame) -> None:
        """Examines the decision on the frame of the stored rows."""
        if self._judge is None or self._converted is None or self._differs_at is not None:
            return
        (rows, pixels), judge = self._converted, self._judge
        if not judge.decides(rows, pixels, frame):
            return
        self._examined += 1
        if not judge.close(rows, pixels, frame):
            return
        self._close += 1
        planned, full = judge.chosen(frame), judge.in_full(rows, pixels)
        if planned != full:
            self._differs_at = frame.number
            now = judge.exposure(frame)
            self._change = self._between(rows, pixels, planned / now, full / now)

    def _between(self, rows: Exposed, pixels: PixelModel, planned: float, full: float) -> float:
        """Largest relative change of the mean pixel value of a strip between two exposures, under
        the light of the frame, with every effect.

        Args:
            planned, full: the exposures, relative to that of the frame.
        """
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
                for factor in (planned, full)
            ]  # fmt: skip
            worst = max(worst, abs(means[0] - means[1]) / max(means[1], 1.0))
        return worst

    def result(self) -> DecisionCheck | None:
        """None if nothing was to be examined."""
        if self._judge is None:
            return None
        return DecisionCheck(self._examined, self._close, self._differs_at, self._change)
