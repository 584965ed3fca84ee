"""Optical flow of a moving texture, by spikes and by frames.

The flow is that between the means of two adjacent windows, whose middles are one window apart. The
window is the shortest of a picture; it is doubled until the median motion in it is NEAR pixels, or
the time is over. The same rule holds for all cameras.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from scenarios.scenes.moving import Texture
from scenarios.studies.tracking.conditions import Conditions
from scenarios.studies.tracking.pictures import Picture
from sensor.reconstruct.motion import flow_grey, optical_flow

NEAR: Final = 8.0
"""Median motion between the windows that is enough, pixels."""
LONGEST: Final = 0.15
"""Longest time of both windows, s."""
WARM: Final = 512
"""Cycles before the first picture, in which the pixels' phases spread; and the frame in which they
end is left out."""
SMOOTH: Final = 1.5
"""Standard deviation of the filter before the flow, pixels."""
MARGIN: Final = 16
"""Width of the border that is not compared, pixels: content enters and leaves there."""
HEADING: Final = 30.0
"""Direction of the motion from the columns, degrees: along no axis of the grid."""


@dataclass(frozen=True)
class Flow:
    """The flow of one texture by one camera.

    Attributes:
        error: mean distance of the flow's velocity from the true one (endpoint error for a motion
            of 1 s), pixels/s.
        window_s: time between the middles of the two windows.
        latency_s: time from the beginning of the first window until the second has been read.
    """

    error: float
    window_s: float
    latency_s: float


def make_texture(conditions: Conditions, speed: float, trial: int) -> Texture:
    """A texture that moves at this speed, pixels/s."""
    random = np.random.Generator(np.random.Philox(key=[conditions.seed, trial]))
    turn = math.radians(HEADING)
    velocity = speed * math.cos(turn), speed * math.sin(turn)
    return Texture(conditions.shape, velocity, seed=int(random.integers(2**32)))


def measure_flow(texture: Texture, pictures: Iterator[Picture], warm: float) -> Flow:
    """The flow in the pictures that begin at `warm`, s, or later."""
    taken: list[Picture] = []
    window = 1
    while True:
        for picture in pictures:
            if picture.start >= warm:
                taken.append(picture)
            if len(taken) == 2 * window:
                break
        first, second = taken[:window], taken[window:]
        flow = optical_flow(_mean(first), _mean(second))
        seconds = second[0].start - first[0].start
        inner = flow[MARGIN:-MARGIN, MARGIN:-MARGIN]
        lengths = np.hypot(inner[..., 0], inner[..., 1])
        if np.median(lengths) >= NEAR or 4 * seconds > LONGEST:
            break
        window *= 2
    wrong = inner / seconds - np.array(texture.velocity)
    error = float(np.mean(np.hypot(wrong[..., 0], wrong[..., 1])))
    return Flow(error, seconds, second[-1].ready - first[0].start)


def _mean(pictures: list[Picture]) -> npt.NDArray[np.uint8]:
    mean = np.mean([p.values for p in pictures], axis=0, dtype=np.float64)
    return flow_grey(np.asarray(mean, np.float32), 1.0, SMOOTH)
