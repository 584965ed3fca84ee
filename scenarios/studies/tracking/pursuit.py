"""One object before one camera: its detection before a known background, its tracker, and what the
tracker knew when.

The difference of a picture to the mean of earlier pictures is smoothed and compared with its own
noise, and the connected components above the threshold are the objects. Background subtraction is
textbook (Szeliski, Computer Vision, section 8.4); the components are those of OpenCV.

The tracker is of the nearest neighbour, with an alpha-beta filter. The filter predicts at a
constant velocity and corrects position and velocity by shares of the residual, alpha and beta.
These are the steady gains of a Kalman filter for a tracking index, the ratio of what the motion is
uncertain by within a picture to the noise of a position (Kalata, IEEE Trans. AES 20:174, 1984). An
object at the speed v that may turn on a radius R accelerates by v^2/R, so the index of pictures at
the distance T is (v T)^2 / (R noise): it follows from the track itself, and all cameras have one
rule. A new track has the gains of a least-squares line through its positions, as long as they are
larger (Brookner, Tracking and Kalman Filtering Made Easy, 1998).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from scenarios.scenes.moving import Spot, Texture
from scenarios.studies.tracking.conditions import Conditions, Picture

Plane = npt.NDArray[np.float32]
SMOOTH: Final = 1.5
"""Standard deviation of the filter, pixels, near that of the object (a matched filter)."""
THRESHOLD: Final = 6.0
"""Threshold over the noise of the difference. Of Gaussian noise, 1e-9 of the pixels are above."""
LEAST: Final = 4
"""Fewest pixels of an object. A smooth peak of noise is smaller, an object of this study larger."""
AROUND: Final = 5.0
"""Standard deviation of the surroundings of a pixel in which its variance is estimated, pixels."""
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
RIGHT: Final = 4.0
"""Largest distance of a right position from the true one, pixels: about the object's width at half
height (4.7)."""
WARM: Final = 0.1
"""Time without the object in which the background is learned, s."""
LONGEST: Final = 0.15
"""Longest time of the object in the image, s."""
LEGS: Final = (0.45, 0.4)
"""Way before and after the turn, over the image's width and height."""
INSTANTS: Final = 400
"""Instants at which the track is compared with the truth."""


@dataclass(frozen=True)
class Detection:
    """An object in a picture.

    Attributes:
        x, y: its centroid, columns and rows, weighted by the difference.
        weight: sum of the difference over its pixels.
    """

    x: float
    y: float
    weight: float


def _smooth(plane: Plane, width: float = SMOOTH) -> Plane:
    import cv2

    # There is no difference beyond the border; a reflected one would double the noise there.
    border = cv2.BORDER_CONSTANT
    return np.asarray(cv2.GaussianBlur(plane, (0, 0), width, borderType=border), np.float32)


@dataclass(frozen=True, eq=False)
class Background:
    """The picture without objects.

    Attributes:
        mean: (H, W) float32.
        noise: standard deviation of the smoothed difference of a later picture to it, (H, W)
            float32.
    """

    mean: Plane
    noise: Plane

    @classmethod
    def learn(cls, pictures: Sequence[Plane]) -> Background:
        """Mean and variance of two or more pictures without objects. With n pictures, the squares
        of the residuals are (n - 1) / n of the variance, and a later difference has (n + 1) / n of
        it. Few pictures give a poor variance of a pixel, so that of its surroundings is taken."""
        n = len(pictures)
        if n < 2:
            raise ValueError(f"a background must have 2 pictures or more, not {n}")
        mean = np.asarray(np.mean(pictures, axis=0, dtype=np.float64), np.float32)
        square = np.zeros_like(mean)
        for picture in pictures:
            square += _smooth(picture - mean) ** 2 / np.float32(n - 1)
        around = _smooth(square, AROUND) / _smooth(np.ones_like(mean), AROUND)
        return cls(mean, np.sqrt(around * np.float32((n + 1) / n)))


def detect(picture: Plane, background: Background) -> list[Detection]:
    """The objects in a picture, the heaviest first."""
    import cv2

    rise = _smooth(picture - background.mean)
    # Without noise, rounding of float32 is left.
    least = np.maximum(THRESHOLD * background.noise, np.float32(1e-5))
    above = (rise > least).astype(np.uint8)
    count, labels = cv2.connectedComponents(above, connectivity=8)
    if count == 1:
        return []
    rows, columns = np.nonzero(above)
    label, weight = labels[rows, columns], rise[rows, columns].astype(np.float64)
    total, x, y = (
        np.bincount(label, weight * factor, count)[1:] for factor in (1.0, columns, rows)
    )
    large = np.bincount(label, minlength=count)[1:] >= LEAST
    found = zip((x / total)[large], (y / total)[large], total[large], strict=True)
    return sorted((Detection(*map(float, each)) for each in found), key=lambda d: -d.weight)


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


@dataclass(frozen=True)
class Pursuit:
    """The measurements of one object. A time is None if it never came.

    Attributes:
        entry_s: time from the object's appearance until the first picture with a right position.
        turn_s: time from the object's turn until the first picture after which the track has a
            right position and a velocity nearer to the new than to the old one.
        lost: share of the time in the image in which the track, predicted to the present, was
            absent or wrong.
        position_px: median distance of detections from the object at the middle of the exposure;
            None without a detection.
    """

    entry_s: float | None
    turn_s: float | None
    lost: float
    position_px: float | None


def make_spot(conditions: Conditions, speed: float, trial: int) -> Spot:
    """An object at a random place and phase that moves from the left to the right and turns by 90
    degrees into the roomier half of the image.

    Args:
        speed: pixels/s.
        trial: number of the repetition.
    """
    random = np.random.Generator(np.random.Philox(key=[conditions.seed, trial]))
    height, width = conditions.shape
    background = Texture(conditions.shape, level=0.2, swing=0.1, seed=int(random.integers(2**32)))
    start = WARM + random.random() / min(conditions.frame_rates)
    heading = math.radians(random.uniform(-15, 15))
    x, y = 0.08 * width, height * random.uniform(0.4, 0.6)
    legs = LEGS[0] * width, LEGS[1] * height
    share = min(1.0, LONGEST * speed / sum(legs))
    knots = [(start, x, y)]
    for leg, length in enumerate(legs):
        if leg == 1:
            heading += math.radians(90 if y < height / 2 else -90)
        time, way = knots[-1][0], share * length
        x, y = x + way * math.cos(heading), y + way * math.sin(heading)
        knots.append((time + way / speed, x, y))
    return Spot(background, tuple(knots))


def _distance(truth: tuple[float, float] | None, x: float, y: float) -> float:
    return math.inf if truth is None else math.hypot(truth[0] - x, truth[1] - y)


def pursue(spot: Spot, pictures: Iterator[Picture]) -> Pursuit:
    """Detects and tracks the object in the pictures of one camera.

    Args:
        spot: the object, which appears at WARM or later.
        pictures: pictures of the camera, from the instant 0 on.
    """
    begin, turn, end = (knot[0] for knot in spot.knots)
    background, early = None, []
    tracker = Tracker()
    known: list[tuple[float, Track | None]] = []
    errors: list[float] = []
    entry = turned = None
    old, new = spot.velocity(0), spot.velocity(1)
    for picture in pictures:
        if picture.start >= end:
            break
        if picture.stop <= WARM:
            early.append(picture.values)
            continue
        background = background or Background.learn(early)
        found = detect(picture.values, background)
        track = tracker.step(picture.middle, found)
        known.append((picture.ready, track))
        truth = spot.position(picture.middle)
        if found and truth is not None:
            errors.append(min(_distance(truth, d.x, d.y) for d in found))
        if track is None or track.misses or _distance(truth, track.x, track.y) > RIGHT:
            continue
        if entry is None:
            entry = picture.ready - begin
        if turned is None and picture.stop > turn:
            after, before = (math.hypot(track.vx - v[0], track.vy - v[1]) for v in (new, old))
            if after < before and track.hits > 1:
                turned = picture.ready - turn
    return Pursuit(
        entry, turned, _lost(spot, begin, end, known),
        float(np.median(errors)) if errors else None,
    )  # fmt: skip


def _lost(spot: Spot, begin: float, end: float, known: list[tuple[float, Track | None]]) -> float:
    """Share of the time in the image without a right position in real time."""
    ready = np.array([time for time, _ in known])
    wrong = 0
    for n in range(INSTANTS):
        now = begin + (end - begin) * (n + 0.5) / INSTANTS
        last = int(np.searchsorted(ready, now, side="right")) - 1
        track = known[last][1] if last >= 0 else None
        wrong += track is None or _distance(spot.position(now), *track.at(now)) > RIGHT
    return wrong / INSTANTS
