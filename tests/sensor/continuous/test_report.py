"""Last reports over time, one after another, are those at each instant."""

from __future__ import annotations

import numpy as np

from cosim import Clock, Intensities
from cosim.spikes.intensities import intensity_image
from sensor.continuous.report import _Last


def test_the_images_are_those_of_the_last_reports():
    rng = np.random.default_rng(5)
    ticks, shape = 50, (4, 6)
    place = np.flatnonzero(rng.random(ticks * 24) < 0.1)
    time, pixel = np.divmod(place, 24)
    row, column = np.divmod(pixel, 6)
    reports = Intensities(
        row.astype(np.uint16), column.astype(np.uint16), time.astype(np.int64),
        rng.uniform(0, 1000, len(time)), shape, ticks, Clock(1000),
    )  # fmt: skip
    instants = np.array([0, 7, 20, 49])
    last = _Last(reports, np.searchsorted(reports.time, instants, side="right"), 0.5)
    for n, tick in enumerate(instants):
        want = np.rint(np.nan_to_num(intensity_image(reports, int(tick))) / 0.5)
        assert (last.read(n) == want).all()
    assert last.read(3).max() > 100
