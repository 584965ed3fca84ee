"""Whether what a plan leaves out changes a decision of the imager's controller.

The paired check (`paired`) converts the exposures of a run in both ways, so it measures what
leaving out does to values, but not to the exposures that follow from them. Here every frame's
decision is examined: how far can the omission move the statistic that the decision is based on, and
does that reach a threshold of the decision? The shift is measured on strips of the frame, converted
with every effect and as planned, with the same random numbers (`judge`). Where a threshold is
within reach, the whole frame is converted with every effect and the decision is made anew. As all
decisions before were alike, the result is the decision of full physics. From the first decision
that differs on, the two runs have different exposures: the change of the pixel values that this
decision makes is the run's error, if it is the larger one, and later frames are not examined.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cosim.frames import Frame
from rtl_model.imagers.check.paired import cut_rows, strips
from rtl_model.imagers.interface.judge import Judge
from sensor.imagers import Exposed, PixelModel

__all__ = ["DecisionCheck", "Decisions"]


@dataclass(frozen=True)
class DecisionCheck:
    """The decisions of a run's controller, compared with those of full physics.

    Attributes:
        examined: frames whose decision was examined.
        close: those of them with a threshold within reach of what is left out.
        differs_at: number of the first frame on which full physics decides otherwise; None if none.
        change: relative change of the mean pixel value that this decision makes; 0 if none.
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
        judge: of the imager's controller; None if there is nothing to examine.
        full: all effects.
        seed: of the temporal noise.
    """

    def __init__(self, judge: Judge | None, full: frozenset[str], seed: int) -> None:
        self._judge = judge
        self._converted: tuple[Exposed, PixelModel] | None = None
        self._full, self._seed = full, seed
        self._examined = self._close = 0
        self._differs_at: int | None = None
        self._change = 0.0

    def see(self, rows: Exposed, pixels: PixelModel) -> None:
        """Takes note of rows that have been converted; the decision on their frame comes next."""
        if self._judge is not None:
            self._converted = rows, pixels

    def frame(self, frame: Frame) -> None:
        """Examines the decision on the frame that these rows have become."""
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
        """Largest relative change of a strip's mean pixel value between two exposures, given as
        multiples of the frame's, under its light, with every effect."""
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
