"""A tracker of one object: nearest neighbour and an alpha-beta filter.

The filter predicts at a constant velocity and corrects position and velocity by shares of the
residual, alpha and beta. These are the steady gains of a Kalman filter for a tracking index, the
ratio of what the motion is uncertain by within a picture to the noise of a position (Kalata, IEEE
Trans. AES 20:174, 1984). An object at the speed v that may turn on a radius R accelerates by
v^2/R, so the index of pictures at the distance T is (v T)^2 / (R noise): it follows from the track
itself, and all cameras have one rule. A new track has the gains of a least-squares line through its
positions, as long as they are larger (Brookner, Tracking and Kalman Filtering Made Easy, 1998).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from scenarios.studies.tracking.detection import Detection

RADIUS: Final = 10.0
"""Radius of a turn, pixels. A smaller one responds sooner and follows the noise more."""
NOISE: Final = 0.15
"""Standard deviation of a detection, pixels: that of an object of this study in eight planes of
spikes."""
HIGHEST: Final = 2 + math.sqrt(2)
"""Highest tracking index: that of beta = 1, where the velocity is that of the last two positions.
Beyond it a wrong velocity overshoots, and keeps the index high."""
GATE: Final = 6.0
"""Farthest detection from the prediction that continues a track at rest, pixels."""
TURN: Final = 1.5
"""The gate grows by this share of the way between two pictures. A turn by 90 degrees needs 1.41."""
MISSES: Final = 3
"""Pictures without a detection within the gate after which a track ends."""


def steady_gains(index: float) -> tuple[float, float]:
    """(alpha, beta) for a tracking index above 0 (Kalata 1984): with
    r = (4 + index - sqrt(8 index + index^2)) / 4, alpha = 1 - r^2 and beta = 2 (1 - r)^2."""
    r = (4 + index - math.sqrt(index * (8 + index))) / 4
    return 1 - r * r, 2 * (1 - r) ** 2


def line_gains(n: int) -> tuple[float, float]:
    """(alpha, beta) with which the n-th position, n >= 2, keeps a least-squares line."""
    return 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))


@dataclass(frozen=True)
class Track:
    """The state of a track.

    Attributes:
        time: time of the state, s.
        x, y: position, columns and rows.
        vx, vy: velocity, pixels/s; 0 after the first detection.
        hits: number of detections that made it.
        misses: pictures since the last detection.
    """

    time: float
    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    hits: int = 1
    misses: int = 0

    def at(self, time: float) -> tuple[float, float]:
        """Predicted position."""
        ahead = time - self.time
        return self.x + self.vx * ahead, self.y + self.vy * ahead


class Tracker:
    """Follows one object. A track begins with the heaviest detection of a picture; the second
    detection, anywhere, gives its velocity; later ones must be near the prediction.

    Attributes:
        track: the present one, None without.
    """

    def __init__(self) -> None:
        self.track: Track | None = None

    def step(self, time: float, detections: Sequence[Detection]) -> Track | None:
        """The track after a picture whose exposure has its middle at `time`, s."""
        old = self.track
        if old is None:
            if detections:
                self.track = Track(time, detections[0].x, detections[0].y)
            return self.track
        px, py = old.at(time)
        ahead = time - old.time
        way = math.hypot(old.vx, old.vy) * ahead
        near = min(detections, key=lambda d: math.hypot(d.x - px, d.y - py), default=None)
        gate = math.inf if old.hits == 1 else GATE + TURN * way
        if near is None or math.hypot(near.x - px, near.y - py) > gate:
            missed = Track(time, px, py, old.vx, old.vy, old.hits, old.misses + 1)
            self.track = missed if missed.misses < MISSES else None
            return self.track
        dx, dy = near.x - px, near.y - py
        index = min(way * way / (RADIUS * NOISE), HIGHEST)
        steady, line = steady_gains(index), line_gains(old.hits + 1)
        alpha, beta = (max(pair) for pair in zip(steady, line, strict=True))
        self.track = Track(
            time, px + alpha * dx, py + alpha * dy, old.vx + beta * dx / ahead,
            old.vy + beta * dy / ahead, old.hits + 1,
        )  # fmt: skip
        return self.track
