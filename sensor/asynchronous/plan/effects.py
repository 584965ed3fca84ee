"""The effects of an asynchronous pixel, and a bound on what each can change, tile by tile.

A bound is the root mean square over the pixels of a tile of the change of the rate that a pixel
reports first (1 / width, or its share of a threshold by the end), over the mean rate of the tile or
the floor. Bounds on random effects hold for the pixels of a tile with a confidence of 99.9 %, and
so does the upper limit of a measurement on them: `_margin` has room for both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Kind, Summary
from cosim.plan.error import DEVIATIONS
from sensor.asynchronous.model import EventModel
from sensor.device.pattern import DevicePattern

LATER: Final = "later reports"
SIDE: Final = 16
"""Pixels along a tile."""
_FAR: Final = 6.0
_RARE: Final = 12.0
"""Readings that chance may move to another level in a tile where next to none should be."""

Reals = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class EventScene(Summary):
    """What bounds need of a scene.

    A `Summary`'s cycle is a second here, and its charge is in thresholds: `darkest` and `brightest`
    are the rates that light and dark current cause, and `floor` is a rate, in spikes/s, as all
    rates are. Arrays have a value per tile.

    Attributes:
        model, pattern: rules of a pixel, and the device.
        tile_of: tile of each pixel, (pixels,).
        pixels: number of pixels.
        mean: mean rate that the pixels report.
        rms: root mean square of the rates that light alone would cause.
        few: effective number of pixels of that mean square.
        read: whether some pixel may be read before it is full.
        stop: end of the run, s.
        steady: whether the light does not change.
    """

    model: EventModel
    pattern: DevicePattern
    tile_of: npt.NDArray[np.int64]
    pixels: Reals
    mean: Reals
    rms: Reals
    few: Reals
    read: npt.NDArray[np.bool_]
    stop: float
    steady: bool

    @property
    def scale(self) -> Reals:
        """What errors of a tile are relative to, spikes a second."""
        return np.maximum(self.mean, self.floor)


def summarise(
    model: EventModel,
    pattern: DevicePattern | None,
    rate: Reals,
    shape: tuple[int, int],
    stop: int,
    steady: bool,
) -> EventScene:
    """rate: (pixels,) electrons a second of light, without the fixed pattern. stop: ps."""
    device = pattern or DevicePattern()
    row, column = np.divmod(np.arange(rate.size), shape[1])
    tile_of = row // SIDE * -(-shape[1] // SIDE) + column // SIDE
    tiles = int(tile_of.max()) + 1

    def summed(values: Reals) -> Reals:
        return np.asarray(np.bincount(tile_of, values, tiles), np.float64)

    pixels = np.bincount(tile_of, minlength=tiles).astype(np.float64)
    light = rate / model.threshold
    fires = light + device.dark / model.threshold
    # A width is at least the shortest, so this is at most the rate that the tile reports.
    reported = fires / (1 + fires * ((model.shortest + model.delay) / PS))
    square, fourth = summed(fires**2), summed(fires**4)
    few = np.divide(square**2, fourth, out=np.ones(tiles), where=fourth > 0)
    brightest, darkest = np.zeros(tiles), np.full(tiles, np.inf)
    np.maximum.at(brightest, tile_of, fires)
    np.minimum.at(darkest, tile_of, light)
    # Six deviations of a threshold, and of a gain.
    sure = 1 + _FAR * (1 / math.sqrt(model.threshold) + device.prnu + device.threshold_fpn)
    read = darkest * (model.longest / PS) < sure if model.longest else np.zeros(tiles, np.bool_)
    longest = min(model.longest or stop, stop)
    return EventScene(
        darkest, brightest, 1.0, 1, max(round(stop / PS), 1), PS / longest, model=model,
        pattern=device, tile_of=tile_of, pixels=pixels, mean=summed(reported) / pixels,
        rms=np.sqrt(square / pixels), few=few, read=read, stop=stop / PS, steady=steady,
    )  # fmt: skip


def _effect(
    name: str, source: str, kind: Kind, work: float, bound: Callable[[EventScene], Reals],
    moot: str = "",
) -> Effect:  # fmt: skip
    """An effect that a tile may leave out.

    Args:
        name, source, kind, moot: see `Effect` and `Bound`.
        work: what leaving it out saves, in draws of a threshold; nothing for what is kept whatever
            it changes.
        bound: bound of what leaving it out changes, by tile; NaN for none.
    """

    def of(scene: Summary) -> Bound:
        if not isinstance(scene, EventScene):
            raise TypeError("the bounds of an asynchronous pixel need an EventScene")
        value = bound(scene)
        return Bound(np.where(np.isnan(value), np.inf, value), kind)

    return Effect(name, source, Stream.NONE, of, lambda scene: work, "tile", moot=moot)


def _margin(independent: Reals) -> Reals:
    """What a root mean square of n normal deviates is multiplied by, so that neither what they turn
    out to be (one in 1e6) nor the upper limit measured of it (DEVIATIONS sqrt(2/n) of its square)
    is above."""
    from scipy.special import chdtri

    n = np.maximum(independent, 1)
    return np.asarray(np.sqrt(chdtri(n, 1e-6) / n * (1 + DEVIATIONS * np.sqrt(2 / n))))


def _spread(q: int) -> float:
    """Relative deviation of Q/Gamma(Q), from E G^-1 = 1/(Q - 1), E G^-2 = 1/((Q - 1)(Q - 2))."""
    return math.sqrt((q + 2) / ((q - 1) * (q - 2))) if q > 2 else math.inf


def _inverse(scene: EventScene) -> float:
    """Root mean square of Q/Gamma(Q): what any other relative change is multiplied by."""
    q = scene.model.threshold
    if not scene.model.shot:
        return 1.0
    return q / math.sqrt((q - 1) * (q - 2)) if q > 2 else math.inf


def _shot_noise(scene: EventScene) -> Reals:
    m = scene.model
    bound = _spread(m.threshold) * scene.rms
    if m.longest:
        # A reading has the deviation of its electrons and of its level, sqrt(Q) and Q/N at most.
        read = (math.sqrt(m.threshold) + m.threshold / m.levels) / m.threshold
        bound = bound + np.where(scene.read, read * PS / m.longest, 0.0)
    return np.asarray(bound / scene.scale * _margin(scene.few))


def _levels(scene: EventScene, change: Reals) -> Reals:
    """What a change of the rate, spikes a second, makes of readings beyond itself: a reading moves
    to the next level as often as the change is large beside a level, 1 / (N longest); the first
    level counts one and a half."""
    m = scene.model
    if not m.longest:
        return np.zeros(scene.mean.shape)
    level = PS / (m.longest * m.levels)
    often = np.minimum(change / level + _RARE / scene.pixels, 1)
    return np.where(scene.read, 1.5 * level * np.sqrt(often), 0.0) / scene.scale


def _relative(scene: EventScene, size: float) -> Reals:
    """A gain's spread."""
    change = size * _inverse(scene) * scene.rms
    return change / scene.scale * _margin(scene.few) + _levels(scene, change)


def _prnu(scene: EventScene) -> Reals:
    return _relative(scene, scene.pattern.prnu)


def _dark(scene: EventScene) -> Reals:
    p, m = scene.pattern, scene.model
    if not p.dark:
        return np.zeros(scene.mean.shape)
    # Of (1 + x)^2, x normal: mean 1 + v, variance 4 v + 2 v^2. The thresholds that are drawn vary
    # what dark current changes as DSNU does.
    v = p.dsnu**2 + (_spread(m.threshold) ** 2 if m.shot else 0.0)
    spread = math.sqrt(4 * v + 2 * v * v) / (1 + v) if v < math.inf else math.inf
    size = p.dark / m.threshold * math.hypot(1, p.dsnu) * _inverse(scene)
    bound = size / scene.scale * (1 + DEVIATIONS * spread / np.sqrt(scene.pixels))
    return np.asarray(bound + _levels(scene, np.full(scene.mean.shape, size)))


def _threshold_fpn(scene: EventScene) -> Reals:
    return _relative(scene, scene.pattern.threshold_fpn)


def _broken(scene: EventScene) -> Reals:
    p = scene.pattern
    hot = math.sqrt(p.hot) * p.hot_current / scene.model.threshold
    change = np.hypot(hot, math.sqrt(p.dead) * scene.rms)
    return change / scene.scale + _levels(scene, change)


def _warm(scene: EventScene) -> Reals:
    # The mean square of an exponential variate is twice its squared mean.
    p = scene.pattern
    size = math.sqrt(2 * p.warm) * p.warm_current / scene.model.threshold
    change = np.full(scene.mean.shape, size)
    return np.asarray(change / scene.scale + _levels(scene, change))


def _later(scene: EventScene) -> Reals:
    """One width over another is a ratio of two Gamma(Q) variables, w/(w + w') being Beta(Q, Q);
    delay and shortest width only bring it nearer to 1. A pixel that fires n times sends again with
    a probability of at most n times that of the ratio leaving 1 by change/sqrt(Q), and its rate is
    then off by about as much."""
    from scipy.special import betainc

    m, q = scene.model, float(scene.model.threshold)
    if not m.change or m.longest or not scene.steady:
        return np.full(scene.mean.shape, math.inf)
    if not m.shot:
        return np.zeros(scene.mean.shape)
    away = m.change / math.sqrt(q)
    often = float(betainc(q, q, 1 / (2 + away)))
    if away < 1:
        often += float(betainc(q, q, (1 - away) / (2 - away)))
        size = away / (1 - away)
    else:
        size = away
    share = np.minimum(scene.brightest * scene.stop * often, 1)
    return np.asarray(np.sqrt(share) * size * scene.rms / scene.scale)


def _nothing_gained(model: EventModel) -> list[Effect]:
    """Kept in any case: they are part of an interval's one formula, or of the stream's format."""
    tick, shortest, delay, reset = (x / PS for x in (
        model.tick, model.shortest, model.delay, model.reset
    ))  # fmt: skip

    def held(scene: EventScene) -> Reals:
        from scipy.special import gammainc

        # (light/G - 1/shortest)+ is at most (light/G - light)+ where light has time enough; over
        # those that are held, by Cauchy and Schwarz with a normal law's fourth moment.
        q, top = float(model.threshold), scene.brightest
        p = gammainc(q, top * q * max(shortest - delay, 0)) if model.shot else 0.0
        held = np.maximum(top - 1 / shortest, 0)
        return np.asarray((_spread(model.threshold) * top * (3 * p) ** 0.25 + held) / scene.scale)

    made = [
        _effect("shortest width", "Huang 2022 section 4.4", "estimate", 0.0, held),
        # A width that begins with the run is up to a tick too long, evenly.
        _effect(
            "timing clock", "an even error within a tick", "proof", 0.0,
            lambda s: np.minimum(s.brightest, 1 / shortest) ** 2 * tick / s.scale,
        ),
    ]  # fmt: skip
    if delay:
        made.append(_effect(
            "comparator delay", "1/w - 1/(w + delay)", "proof", 0.0,
            lambda s: s.brightest**2 * delay / s.scale,
        ))  # fmt: skip
    if reset:
        made.append(_effect(
            "reset dead time", "of the spikes' number: 1/w - 1/(w + reset)", "proof", 0.0,
            lambda s: s.brightest**2 * reset / s.scale,
        ))  # fmt: skip
    if model.longest:
        made.append(_effect(
            "longest width", "what is read is below a threshold", "proof", 0.0,
            lambda s: np.minimum(s.brightest, PS / model.longest) / s.scale,
        ))  # fmt: skip
    if model.change:
        made.append(_effect(
            "first-spike rule", "what is not sent is this near to what was", "proof", 0.0,
            lambda s: model.change / math.sqrt(model.threshold) * s.mean / s.scale,
        ))  # fmt: skip
    return made


def event_effects(model: EventModel, pattern: DevicePattern | None) -> tuple[Effect, ...]:
    """Every effect that acts, first those that can be left out."""
    p = pattern or DevicePattern()
    made = [
        (
            model.shot,
            _effect(
                "shot noise", "deviation of Q/Gamma(Q): Huang 2022 section 5.1", "proof", 1.0,
                _shot_noise,
            ),
        ),
        (p.prnu > 0, _effect("PRNU", "EMVA 1288 release 4.0", "proof", 3.0, _prnu)),
        (
            p.dark > 0,
            _effect("dark current and DSNU", "Huang 2022 section 4.4", "proof", 3.0, _dark),
        ),
        (
            p.threshold_fpn > 0,
            _effect("threshold FPN", "capacitance mismatch", "estimate", 3.0, _threshold_fpn),
        ),
        (
            p.hot * p.hot_current + p.dead > 0,
            _effect("hot and dead pixels", "EMVA 1288", "estimate", 2.0, _broken),
        ),
        (
            p.warm * p.warm_current > 0,
            _effect("warm pixels", "exponential dark currents", "estimate", 2.0, _warm),
        ),
        (
            model.change > 0,
            _effect(
                LATER, "ratio of two widths: Beta(Q, Q)", "estimate", 20.0, _later,
                # Without shot noise all widths of a pixel are the same, and it sends once.
                "" if model.longest else "shot noise",
            ),
        ),
    ]  # fmt: skip
    return (*(effect for acts, effect in made if acts), *_nothing_gained(model))
