"""The decisions of the imagers' controllers, looked at from outside: what a frame's decision was,
whether what is left out could reach one of its limits, and what full physics decides.

Adaptive exposure decides by the count of saturated pixels and the largest value below saturation.
Any pixel may be moved by what is left out as far as those of the strip around the largest value
are: their largest difference, or as far as normal tails of their differences go among all pixels of
a frame at 99.9 %, and one DN for the converter's truncation. The EBAPS decides by the mean: the
mean difference of a strip and what the strip's own spread leaves open of it, at 99.9 %, the darks
that are taken away in it.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from cosim.frames import Frame
from rtl_model.imagers.run.paired import STRIP, cut_rows, strips
from sensor.imagers import Exposed, PixelModel
from sensor.latched.paired import CONFIDENCE

__all__ = ["Judge", "decides", "judge_of"]

_FULL = 256
"""DN of full scale of 8 bits, in front of the converter."""
_TRUNCATION = 1.0
"""DN by which truncation may lengthen a difference."""
Values = npt.NDArray[np.float64]


class Judge(Protocol):
    """Of one imager's controller, asked after each frame."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether an exposure hung on this frame; is shown every frame."""
        ...

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether what is left out could reach a limit of the decision."""
        ...

    def chosen(self, frame: Frame) -> int:
        """The exposure that the run decided for."""
        ...

    def in_full(self, rows: Exposed, pixels: PixelModel) -> int:
        """The one that full physics decides for, from the same light and random numbers."""
        ...

    def exposure(self, frame: Frame) -> float:
        """Of the frame itself, in the same unit."""
        ...


def decides(imager: Any) -> bool:
    """Whether frames decide anything of those that follow."""
    return imager.name in _KINDS


def judge_of(imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> Judge | None:
    """None of an imager whose frames decide nothing."""
    return _KINDS[imager.name](imager, full, kept, seed) if decides(imager) else None


def _deviations(among: int) -> float:
    """Standard deviations that none of so many normal numbers exceeds, at the confidence."""
    return -float(ndtri((1 - CONFIDENCE) / 2 / max(among, 1)))


class _Base:
    def __init__(self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> None:
        self._imager, self._full, self._kept, self._seed = imager, full, kept, seed


class _Adaptive(_Base):
    """See `Judge`. Exposures are multiples of the shortest."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        return self._imager.controller.judged.user is None

    def chosen(self, frame: Frame) -> int:
        return int(frame.state["next_multiplier"])

    def exposure(self, frame: Frame) -> float:
        return frame.state["multiplier"]

    def in_full(self, rows: Exposed, pixels: Any) -> int:
        from rtl_model.imagers.adaptive.statistics import gather

        judged = self._imager.controller.judged
        values, over = pixels.digitise(rows, self._seed, self._full)
        counting = judged.counting
        seen = gather(values, over, counting.window, whole_scan=counting.whole_scan)
        return int(judged.chosen(seen))

    def _reach(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> float:
        """DN by which what is left out may move a pixel."""
        values = frame.values
        brightest = int(np.argmax(np.where(values < _FULL - 1, values, 0).max(axis=1)))
        first = min(max(brightest - STRIP // 2, 0), max(values.shape[0] - STRIP, 0))
        at = slice(first, min(first + STRIP, values.shape[0]))
        full = pixels.convert(cut_rows(rows, at), self._seed, self._full)
        step = full.astype(np.float64) - values[at]
        far = abs(float(step.mean())) + _deviations(values.size) * float(step.std())
        return _TRUNCATION + max(float(np.abs(step).max()), far)

    def _surely_full(self, rows: Exposed, pixels: Any, reach: float) -> npt.NDArray[np.bool_]:
        """(H, W) pixels that are over full scale however their noise and pattern fall."""
        s = pixels.setting
        seconds = float(rows.seconds[0])
        dark, noise = pixels.mean_variance(0.0, seconds)
        unit, more = pixels.mean_variance(1.0, seconds)
        level = dark + (unit - dark) * rows.lux_seconds
        variance = noise + (more - noise) * rows.lux_seconds
        variance = variance + (s.prnu * level) ** 2 + (s.column * _FULL) ** 2
        far = level - _deviations(level.size) * np.sqrt(variance)
        return np.asarray(far > _FULL + reach)

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        from rtl_model.imagers.adaptive.decision import lengthening

        window, threshold, whole = self._imager.controller.judged.counting
        inside = (slice(window.top, window.bottom + 1), slice(window.left, window.right + 1))
        reach = self._reach(rows, pixels, frame)
        top = _FULL - 1 - reach
        surely = self._surely_full(rows, pixels, reach)
        least = int(surely[inside].sum())
        most = int((frame.values[inside] >= top).sum())
        if least > threshold:
            return False  # shortened, whatever is left out
        if most > threshold:
            return True
        where = (slice(None), slice(None)) if whole else inside
        values, largest = frame.values[where], frame.state["largest"]
        below = values[values < top]
        if largest >= _FULL or not below.size:
            return True
        # What is near full scale may be saturated or not: then the largest below it counts, or it.
        low = float(below.max() if largest >= top else largest) - reach
        marginal = bool(((values >= top) & ~surely[where]).any())
        high = _FULL - 1.0 if marginal else min(float(largest) + reach, _FULL - 1.0)
        ends = (int(max(np.floor(low), 0)), int(np.ceil(high)))
        return lengthening(ends[0]) != lengthening(ends[1])


class _Ebaps(_Base):
    """See `Judge`. Exposures are ns."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._darks: list[tuple[Exposed, PixelModel]] = []
        self._made: dict[tuple[int, int, frozenset[str]], npt.NDArray[np.uint16]] = {}

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        if frame.state["key"]:
            self._darks = [*self._darks, (rows, pixels)][-4:]
            self._made.clear()
            return False
        judged = self._imager.sequencer.judged
        return bool(judged is not None and judged.acts)

    def chosen(self, frame: Frame) -> int:
        return int(frame.state["next_exposure_ns"])

    def exposure(self, frame: Frame) -> float:
        return frame.state["exposure_ns"]

    def _shown(self, rows: Exposed, pixels: PixelModel, at: slice, kept: frozenset[str]) -> Values:
        """What the loop takes the mean of, over these rows."""
        from rtl_model.imagers.ebaps.darks import mean_of_four, subtract

        live = pixels.convert(cut_rows(rows, at), self._seed, kept)
        sequencer = self._imager.sequencer
        if sequencer.judged.raw or not sequencer.subtracts():
            return live.astype(np.float64)
        key = (at.start, at.stop, kept)
        if key not in self._made:
            self._made[key] = mean_of_four([
                model.convert(cut_rows(dark, at), self._seed, kept) for dark, model in self._darks
            ])  # fmt: skip
        return subtract(live, self._made[key], sequencer.pedestal()).astype(np.float64)

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        judged = self._imager.sequencer.judged
        mean = frame.state["raw_mean" if judged.raw else "mean"]
        reach = 0.0
        for at in strips(rows):
            full, planned = (self._shown(rows, pixels, at, k) for k in (self._full, self._kept))
            step = full - planned
            doubt = _deviations(1) * float(step.std()) / np.sqrt(step.size)
            reach = max(reach, abs(float(step.mean())) + doubt)
        count = frame.values.size
        ends = (mean + side * reach for side in (-1, 1))
        low, high = (judged.chosen(round(end * count), count) for end in ends)
        return bool(low != high)

    def in_full(self, rows: Exposed, pixels: PixelModel) -> int:
        whole = slice(0, rows.lux_seconds.shape[0])
        shown = self._shown(rows, pixels, whole, self._full)
        judged = self._imager.sequencer.judged
        return int(judged.chosen(int(shown.sum()), shown.size))


_KINDS: dict[str, type[_Adaptive | _Ebaps]] = {"adaptive-exposure": _Adaptive, "ebaps": _Ebaps}
"""By an imager's name; of others no frame decides anything."""
