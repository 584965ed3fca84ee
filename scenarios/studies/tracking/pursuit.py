"""One object before one camera: what the tracker knew, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from scenarios.scenes.moving import Spot, Texture
from scenarios.studies.tracking.conditions import Conditions
from scenarios.studies.tracking.detection import Background, detect
from scenarios.studies.tracking.pictures import Picture
from scenarios.studies.tracking.tracker import Track, Tracker

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
