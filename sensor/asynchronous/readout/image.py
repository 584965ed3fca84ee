"""Images from events: TFI, one threshold over the width that holds the instant."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.spikes.events import Events


def rate_image(events: Events, tick: int, threshold: float, delay: float = 0.0) -> np.ndarray:
    """Electrons a second of every pixel in a tick, (H, W) float64; 0 where nothing is known yet.

    Huang 2022 sections 3.3.2 and 5.2: the width of the event whose interval holds the tick, else
    that of the last event before it, which holds until something else is sent. A reading below
    threshold counts as the middle of its level, level 0 as nothing. delay: seconds of the
    comparator, in every spike's width; a reading is taken as the longest width is up.
    """
    height, width = events.shape
    place = events.row.astype(np.int64) * width + events.column
    cut = int(np.searchsorted(events.time, tick))
    chosen: npt.NDArray[np.int64] = np.full(height * width, -1, np.int64)
    chosen[place[:cut]] = np.arange(cut)  # of several the last is kept
    after = np.full(height * width, -1, np.int64)
    after[place[cut:][::-1]] = np.arange(cut, len(events))[::-1]
    begins = events.time[after] - events.width[after] if len(events) else after
    holds = (after >= 0) & (begins < tick)
    chosen = np.where(holds, after, chosen)
    known = chosen >= 0
    rate = np.zeros(height * width)
    at = chosen[known]
    seconds = events.width[at] * float(events.clock.period)
    charge = np.full(at.size, float(threshold))
    if events.level is None:
        seconds -= delay
    else:
        seconds -= np.where(events.level[at] == events.levels, delay, 0.0)
        level = events.level[at].astype(np.float64)
        share = np.where(level == 0, 0.0, (level + 0.5) / events.levels)
        charge *= np.where(level == events.levels, 1.0, share)
    rate[known] = charge / np.maximum(seconds, 1e-15)
    return rate.reshape(height, width)
