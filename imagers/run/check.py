"""The check of a plan: the error of pixel values, and the decisions of the imager's controller.

Patches of the exposures of a run are converted repeatedly in two ways, with every effect and as
planned, with the same random numbers. The repeats give the mean and the temporal variance of every
pixel in both ways. The error of a patch is the larger of two figures. The first is the RMS change
of the pixel means, relative to the mean of the patch (at least one DN). The second is the change of
the temporal noise, relative to that noise (at least the noise of rounding to one DN). With d the
difference of a repeat and R repeats, E[(mean of d)^2] is the squared shift plus var(d)/R; the
second term is subtracted. The limits hold at 99.9 % for all patches together. The squares of the
pixels are treated as samples of one distribution.

The paired check measures how the omission changes pixel values, but not how it changes the
exposures that follow from them. So the decision on every frame is examined (`Decisions`): how far
can the omission move the statistic of the decision, and does this reach a decision threshold? The
shift is measured on strips of the frame, converted in both ways with the same random numbers
(`JudgeBase`). If a threshold is within reach, the whole frame is converted with every effect and
the decision is repeated. All earlier decisions agreed, so the result is the decision of full
physics. At the first decision that differs, the exposures of the two runs diverge. The resulting
change of the pixel values is then the error of the run, if it exceeds the paired error, and later
frames are not examined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from cosim.plan.error import Measured, deviations
from imagers.common.model import Judge
from sensor.frame_pixels import Exposed, PixelModel

WATCHED: Final = 4
"""Number of frames, evenly spaced, on whose exposures the plan is checked."""

REPEATS: Final = (32, 256)
"""Least and largest number of conversions of a strip in each way."""
VALUES: Final = 1 << 16
"""Number of values, pixels times repeats, that are aimed at for a strip in each way."""
STRIP: Final = 8
"""Rows of a strip."""
ACROSS: Final = 4
"""Largest number of patches side by side in a strip."""
LEAST: Final = 512
"""Least number of pixels of a patch where a strip is divided."""
FIRST_REPEAT: Final = 1 << 24
"""Frame number of the first repeat, beyond the frame numbers of any run."""
ROUNDING: Final = 1 / np.sqrt(12.0)
"""Standard deviation of rounding to whole DN."""
_PLAN: Final = "the plan"
Values = npt.NDArray[np.float64]


def paired_error(planned: Values, full: Values, many: int) -> Measured:
    """The error of one patch.

    Args:
        planned, full: (repeats, pixels) DN, as planned and with every effect.
        many: number of patches for which the limits hold together.
    """
    repeats, pixels = full.shape
    wide = deviations(2 * many)
    step = planned - full
    square = step.mean(axis=0) ** 2 - step.var(axis=0, ddof=1) / repeats
    base = max(float(full.mean()), 1.0)
    shift, doubt = float(square.mean()), wide * float(square.std()) / np.sqrt(pixels)
    mean, mean_low, mean_high = (
        float(np.sqrt(max(v, 0.0))) / base for v in (shift, shift - doubt, shift + doubt)
    )
    gain = planned.var(axis=0, ddof=1) - full.var(axis=0, ddof=1)
    sigma = [float(np.sqrt(x.var(axis=0, ddof=1).mean())) for x in (planned, full)]
    under = max(sum(sigma), 1e-300) * max(sigma[1], ROUNDING)
    change = abs(float(gain.mean())) / under
    doubt = wide * float(gain.std()) / np.sqrt(pixels) / under
    low, high = max(change - doubt, 0.0), change + doubt
    return Measured(max(mean, change), max(mean_low, low), max(mean_high, high))


def watched_frames(frames: int) -> list[int]:
    """Numbers of the frames to check, evenly spaced in a run of `frames` frames."""
    return sorted({int((n + 0.5) * frames / WATCHED) for n in range(WATCHED)})


def strips(rows: Exposed) -> list[slice]:
    """Strips of rows that represent a frame: near the top, in the middle, near the bottom."""
    # A frame transfer exposes all rows together and may read a window of them.
    window = getattr(rows, "read", None) or (0, rows.lux_seconds.shape[0])
    begin, end = window[0], sum(window)
    spare = max(end - begin - STRIP, 0)
    starts = sorted({begin + int(spare * part) for part in (0.12, 0.5, 0.88)})
    return [slice(first, min(first + STRIP, end)) for first in starts]


def cut_rows(rows: Exposed, at: slice) -> Exposed:
    """The exposure of these rows alone."""
    every: dict[str, Any] = {"read": None} if hasattr(rows, "read") else {}
    every |= {name: v[at] for name, v in vars(rows).items() if isinstance(v, np.ndarray)}
    return replace(rows, first=rows.first + at.start, **every)


class Patches:
    """Compares sets of effects on chosen exposures of a run.

    Attributes:
        count: number of patches compared.

    Args:
        full: names of all effects.
        ways: name -> set of effects that are kept; each is compared with `full`.
        seed: seed of the temporal noise.
        frames: numbers of the frames to compare.
    """

    def __init__(
        self, full: frozenset[str], ways: Mapping[str, frozenset[str]], seed: int,
        frames: Sequence[int],
    ) -> None:  # fmt: skip
        self._full, self._seed, self._frames = full, seed, frozenset(frames)
        self._ways = dict(ways)
        self._pairs: dict[str, list[tuple[Values, Values]]] = {name: [] for name in ways}
        self.count = 0

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        """Compares the rows that were converted last, if their frame is one of the chosen ones."""
        if rows.frame not in self._frames or not self._ways:
            return
        for at in strips(rows):
            self._strip(rows, pixels, at)

    def _strip(self, rows: Exposed, pixels: PixelModel, at: slice) -> None:
        cut = cut_rows(rows, at)
        size = cut.lux_seconds.size
        many = min(max(VALUES // size, REPEATS[0]), REPEATS[1])
        across = min(max(size // LEAST, 1), ACROSS)

        def repeats(kept: frozenset[str]) -> list[Values]:
            """(repeats, pixels) of each patch of the strip."""
            first = FIRST_REPEAT + rows.frame * REPEATS[1]
            values = [
                pixels.convert(replace(cut, frame=first + n), self._seed, kept).astype(np.float64)
                for n in range(many)
            ]
            parts = np.array_split(np.stack(values), across, axis=2)
            return [part.reshape(many, -1) for part in parts if part.size]

        full = repeats(self._full)
        self.count += len(full)
        for name, kept in self._ways.items():
            self._pairs[name] += zip(repeats(kept), full, strict=True)

    def of(self, name: str) -> Measured | None:
        """The error of the worst patch for one set of effects, with the largest upper limit of all
        patches; None if no patch was compared."""
        pairs = self._pairs.get(name, [])
        return Measured.worst(paired_error(planned, full, len(pairs)) for planned, full in pairs)


class PlanPatches(Patches):
    """Patches that check a plan as a whole, and the omission of each effect alone.

    Args:
        effects: names of all effects.
        out: names of the effects that the plan omits.
        seed: seed of the temporal noise.
        frames: numbers of the frames to compare.
    """

    def __init__(
        self, effects: Sequence[str], out: Sequence[str], seed: int, frames: Sequence[int]
    ) -> None:
        full = frozenset(effects)
        ways = {_PLAN: full - set(out)} if out else {}
        if len(out) > 1:
            ways |= {name: full - {name} for name in out}
        super().__init__(full, ways, seed, frames)
        self._out = list(out)

    def planned(self) -> Measured | None:
        """The error of the plan; None if no frame was compared."""
        return self.of(_PLAN) if self._out else Measured(0.0, 0.0, 0.0)

    def measured(self, effect: str) -> Measured | None:
        """The error of omitting one effect alone; None if no frame was compared."""
        return self.of(effect if len(self._out) > 1 else _PLAN)


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
