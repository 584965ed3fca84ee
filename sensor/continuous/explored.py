"""The explorer of a continuous camera: the values that its pixels have reported, over time."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Intensities
from cosim.config.amounts import amount
from cosim.report.frames import FRAMES, FrameColumn, frames_part
from sensor.continuous.run import ContinuousRun

_FULL: Final = 65_535
"""Largest value shown."""


class _Last:
    """The last reports as whole numbers of a step, at instants that are asked for in order."""

    def __init__(self, reports: Intensities, until: npt.NDArray[np.intp], step: float) -> None:
        self._reports, self._until, self._step = reports, until, step
        self._image = np.zeros(reports.shape, np.uint16)
        self._done = 0

    def read(self, n: int) -> npt.NDArray[np.uint16]:
        """The image of the n-th instant, black where nothing was reported; it is changed by the
        next."""
        new = slice(self._done, int(self._until[n]))
        value = np.minimum(np.rint(self._reports.value[new] / self._step), _FULL)
        # Of several reports of a pixel the last one stays.
        self._image.ravel()[self._reports.pixel[new]] = value.astype(np.uint16)
        self._done = new.stop
        return self._image


def reports_explorer(judged: ContinuousRun) -> str:
    """HTML of the section."""
    spec, reports = judged.spec, judged.views.reports
    clock, cycles = reports.clock, reports.ticks
    instants = np.unique(np.linspace(0, cycles - 1, min(cycles, FRAMES)).round().astype(np.int64))
    step = max(float(reports.value.max(initial=0.0)), spec.white) / _FULL
    until = np.searchsorted(reports.time, reports.start + instants, side="right")
    last = _Last(reports, until, step)
    figures = [(float(one.mean()), int(one.min()), int(one.max())) for one in map(
        last.read, range(len(instants))
    )]  # fmt: skip
    mean, least, most = zip(*figures, strict=True)
    columns = [
        FrameColumn("Frame", "mean", "", mean),
        FrameColumn("Frame", "least", "", least),
        FrameColumn("Frame", "most", "", most),
        FrameColumn("Reports", "so_far", "", until.tolist()),
        FrameColumn("Reports", "new", "", np.diff(until, prepend=0).tolist()),
    ]
    unit = f"x {amount(step, 'e/s')}"
    part = frames_part(
        [reports.shape] * len(instants), _Last(reports, until, step).read, _FULL,
        [int(t) for t in instants], [clock.middle(int(t)) / 1e9 for t in instants], columns,
        {"new": "since the instant before"}, unit=unit, drawn="new",
    )  # fmt: skip
    return (
        f"<h2>Explore the reports</h2><p>What every pixel has reported last, at {len(instants)} "
        f"instants; a frame is a cycle of the {amount(clock.hz, 'Hz')} clock. Values are in steps "
        f"of {amount(step, 'e/s')}, {_FULL} is the brightest of white and all reports.</p>{part}"
    )
