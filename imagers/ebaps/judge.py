"""The judge of the exposure loop.

The loop decides by the mean of a frame. The effects that are left out are assumed to change it by
the mean difference of a strip plus the 99.9 % uncertainty of that mean, subtracted dark frames
included.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from imagers.common.judge import JudgeBase, deviations
from imagers.ebaps.device.darks import mean_of_four, subtract
from imagers.run.paired import cut_rows, strips
from sensor.frame_pixels import Exposed, PixelModel

__all__ = ["EbapsJudge"]

Values = npt.NDArray[np.float64]


class EbapsJudge(JudgeBase):
    """See `Judge`. Exposures are in ns."""

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
        """The values of these rows of which the loop takes the mean."""
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
            doubt = deviations(1) * float(step.std()) / np.sqrt(step.size)
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
