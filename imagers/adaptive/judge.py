"""The judge of the exposure selection.

The selection depends on the number of saturated pixels and on the largest value below saturation.
The shift that the omitted effects may cause in any pixel is estimated on a strip around the largest
value. It is the largest difference there, or the normal limit of the differences for all pixels of
a frame at 99.9 %, whichever is larger, plus one DN for the truncation of the converter.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from imagers.adaptive.device.decision import lengthening
from imagers.adaptive.device.statistics import gather
from imagers.common.judge import JudgeBase, deviations
from imagers.run.paired import STRIP, cut_rows
from sensor.frame_pixels import Exposed, PixelModel

__all__ = ["AdaptiveJudge"]

_FULL = 256
"""Full scale of 8 bits before the converter, DN."""
_TRUNCATION = 1.0
"""Largest increase of a difference by truncation, DN."""


class AdaptiveJudge(JudgeBase):
    """See `Judge`. Exposures are multiples of the shortest one."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        return self._imager.controller.judged.user is None

    def chosen(self, frame: Frame) -> int:
        return int(frame.state["next_multiplier"])

    def exposure(self, frame: Frame) -> float:
        return frame.state["multiplier"]

    def in_full(self, rows: Exposed, pixels: Any) -> int:
        judged = self._imager.controller.judged
        values, over = pixels.digitise(rows, self._seed, self._full)
        counting = judged.counting
        statistics = gather(values, over, counting.window, whole_scan=counting.whole_scan)
        return int(judged.chosen(statistics))

    def _reach(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> float:
        """Largest shift of a pixel by the omitted effects, DN."""
        values = frame.values
        brightest = int(np.argmax(np.where(values < _FULL - 1, values, 0).max(axis=1)))
        first = min(max(brightest - STRIP // 2, 0), max(values.shape[0] - STRIP, 0))
        at = slice(first, min(first + STRIP, values.shape[0]))
        full = pixels.convert(cut_rows(rows, at), self._seed, self._full)
        step = full.astype(np.float64) - values[at]
        far = abs(float(step.mean())) + deviations(values.size) * float(step.std())
        return _TRUNCATION + max(float(np.abs(step).max()), far)

    def _surely_full(self, rows: Exposed, pixels: Any, reach: float) -> npt.NDArray[np.bool_]:
        """(H, W) whether a pixel exceeds full scale for every likely noise and fixed pattern."""
        s = pixels.setting
        seconds = float(rows.seconds[0])
        dark, noise = pixels.mean_variance(0.0, seconds)
        unit, more = pixels.mean_variance(1.0, seconds)
        level = dark + (unit - dark) * rows.lux_seconds
        variance = noise + (more - noise) * rows.lux_seconds
        variance = variance + (s.prnu * level) ** 2 + (s.column * _FULL) ** 2
        far = level - deviations(level.size) * np.sqrt(variance)
        return np.asarray(far > _FULL + reach)

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        window, threshold, whole = self._imager.controller.judged.counting
        inside = (slice(window.top, window.bottom + 1), slice(window.left, window.right + 1))
        reach = self._reach(rows, pixels, frame)
        top = _FULL - 1 - reach
        surely = self._surely_full(rows, pixels, reach)
        least = int(surely[inside].sum())
        most = int((frame.values[inside] >= top).sum())
        if least > threshold:
            return False  # shortened with or without the omitted effects
        if most > threshold:
            return True
        where = (slice(None), slice(None)) if whole else inside
        values, largest = frame.values[where], frame.state["largest"]
        below = values[values < top]
        if largest >= _FULL or not below.size:
            return True
        # A pixel near full scale may be saturated or not. So the largest value is that pixel's, or
        # the largest one below it.
        low = float(below.max() if largest >= top else largest) - reach
        marginal = bool(((values >= top) & ~surely[where]).any())
        high = _FULL - 1.0 if marginal else min(float(largest) + reach, _FULL - 1.0)
        ends = (int(max(np.floor(low), 0)), int(np.ceil(high)))
        return lengthening(ends[0]) != lengthening(ends[1])
