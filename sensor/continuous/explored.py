"""The explorer of a continuous camera: the values that its pixels have reported, over time."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount
from cosim.report.frames import FRAMES, FrameColumn, frames_part
from cosim.spikes.intensities import intensity_image
from sensor.continuous.run import ContinuousRun

__all__ = ["reports_explorer"]

_FULL: Final = 65_535
"""Largest value shown."""


def reports_explorer(judged: ContinuousRun) -> str:
    """Returns the HTML of the section."""
    spec, reports = judged.spec, judged.views.reports
    clock, cycles = reports.clock, reports.ticks
    instants = np.unique(np.linspace(0, cycles - 1, min(cycles, FRAMES)).round().astype(np.int64))
    step = max(float(reports.value.max(initial=0.0)), spec.white) / _FULL

    def read(n: int) -> npt.NDArray[np.uint16]:
        value = np.nan_to_num(intensity_image(reports, int(instants[n])))
        return np.minimum(np.rint(value / step), _FULL).astype(np.uint16)

    pictures = [read(n) for n in range(len(instants))]
    until = np.searchsorted(reports.time, instants, side="right")
    columns = [
        FrameColumn("Frame", "mean", "", [float(one.mean()) for one in pictures]),
        FrameColumn("Frame", "least", "", [int(one.min()) for one in pictures]),
        FrameColumn("Frame", "most", "", [int(one.max()) for one in pictures]),
        FrameColumn("Reports", "so_far", "", [int(n) for n in until]),
        FrameColumn("Reports", "new", "", [int(n) for n in np.diff(until, prepend=0)]),
    ]
    unit = f"x {amount(step, 'e/s')}"
    part = frames_part(
        [reports.shape] * len(instants), pictures.__getitem__, _FULL,
        [int(t) for t in instants], [clock.middle(int(t)) / 1e9 for t in instants], columns,
        {"new": "since the instant before"}, unit=unit, drawn="new",
    )  # fmt: skip
    return (
        f"<h2>Explore the reports</h2><p>What every pixel has reported last, at {len(instants)} "
        f"instants; a frame is a cycle of the {amount(clock.hz, 'Hz')} clock. Values are in steps "
        f"of {amount(step, 'e/s')}, {_FULL} is the brightest of white and all reports.</p>{part}"
    )
