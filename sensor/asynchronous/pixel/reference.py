"""The asynchronous pixel at full length: every interval by itself, nothing jumped over.

The truth that the engine is held against, so it shares none of its short cuts: quantiles are
scipy's own at the words that the engine looks up in its table, the instant at which a pixel is full
is found by Newton's steps inside a bracket on the charge, which is monotone, and the electrons of a
reading by adding up the Poisson law. Instants are whole picoseconds and a float64 fraction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import PS
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.light.light import Light
from sensor.asynchronous.model import EventModel
from sensor.device.pattern import DevicePattern

Reals = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
Numbers = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Followed:
    """The first intervals of n pixels, as far as they have ended; arrays are (n, intervals).

    Attributes:
        exact: widths, ps.
        width: width in ticks.
        instant: instant of the end, ps, rounded up.
        level: `EventModel.levels` for a spike.
        sent: whether the rule of changes sends it.
        count: intervals that ended, (n,).
        progress: share of its threshold that the interval then under way has gathered, at most 1,
            (n,).
    """

    exact: Reals
    width: Whole
    instant: Whole
    level: npt.NDArray[np.uint16]
    sent: npt.NDArray[np.bool_]
    count: Whole
    progress: Reals


def _words(numbers: Numbers, k: npt.NDArray[np.uint64], seed: int, stream: Stream) -> tuple[
    npt.NDArray[np.uint32], ...
]:  # fmt: skip
    high, low = k >> np.uint64(32), k & np.uint64(0xFFFFFFFF)
    return tuple(philox4x32((numbers[:, None], high, low, 0), (seed, stream)))


def exact_thresholds(model: EventModel, numbers: Numbers, intervals: int) -> Reals:
    """Thresholds of intervals 0 .. `intervals`, electrons, (n, intervals): the quantile of
    Gamma(Q) at (word + 1/2) / 2^32, each tail from its own end."""
    from scipy.special import gammainccinv, gammaincinv

    q = float(model.threshold)
    if not model.shot:
        return np.full((numbers.size, intervals), q)
    k = np.arange(intervals, dtype=np.uint64)
    four = np.stack(_words(numbers, k >> np.uint64(2), model.seed, Stream.SHOT_NOISE))
    chosen = np.broadcast_to((k & np.uint64(3)).astype(np.intp), four.shape[1:])
    word = np.take_along_axis(four, chosen[None], 0)[0]
    below = word < 2**31
    y = np.where(below, word, ~word)
    p = (y.astype(np.float64) + 0.5) / 2.0**32
    found = np.empty(p.shape)
    found[below], found[~below] = gammaincinv(q, p[below]), gammainccinv(q, p[~below])
    return found


def _shares(model: EventModel, numbers: Numbers, intervals: int) -> Reals:
    """Where in its law the reading of each interval lies, in (0, 1)."""
    if not (model.longest and model.shot):
        return np.zeros((numbers.size, intervals))
    k = np.arange(intervals, dtype=np.uint64)
    w0, w1, *_ = _words(numbers, k, model.seed, Stream.READING)
    u = (w0.astype(np.float64) + (w1.astype(np.float64) + 0.5) / 2.0**32) / 2.0**32
    return np.minimum(u, 1 - 2.0**-53)


@njit(cache=True, error_model="numpy", nogil=True)
def _full(rate, slope, left, need):  # type: ignore[no-untyped-def]
    """Where within `left` the charge rate x + slope x^2 / 2 reaches `need`, -1 where nowhere."""
    if need <= 0.0:
        return 0.0
    if (rate + 0.5 * slope * left) * left < need:
        return -1.0
    low, high = 0.0, left
    x = min(need / rate, left) if rate > 0.0 else 0.5 * left
    for _ in range(200):
        over = (rate + 0.5 * slope * x) * x - need
        if over < 0.0:
            low = x
        else:
            high = x
        steep = rate + slope * x
        after = x - over / steep if steep > 0.0 else -1.0
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - x) <= 1e-16 * x or not low < after < high:
            return after
        x = after
    return x


@njit(cache=True, error_model="numpy", nogil=True)
def _reading(mean, q, u):  # type: ignore[no-untyped-def]
    """Quantile u of Poisson(mean) given that it is below q: its law added up from nothing on."""
    if mean <= 0.0:
        return 0
    top = min(int(mean), q - 1)
    peak = top * math.log(mean) - math.lgamma(top + 1.0)
    whole = 0.0
    for k in range(q):
        whole += math.exp(k * math.log(mean) - math.lgamma(k + 1.0) - peak)
    gone = 0.0
    for k in range(q):
        gone += math.exp(k * math.log(mean) - math.lgamma(k + 1.0) - peak)
        if gone >= u * whole:
            return k
    return q - 1


@njit(cache=True, error_model="numpy", nogil=True)
def _ticks(instant, part, tick):  # type: ignore[no-untyped-def]
    whole = instant + (1 if part > 0.0 else 0)
    return -(-whole // tick)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True, error_model="numpy")
def _follow(  # type: ignore[no-untyped-def]
    rates, slopes, begins, ends, goals, shares, shot, q, tick, shortest, longest, levels, delay,
    reset, change, exact, width, instant, level, sent, count, progress,
):  # fmt: skip
    """See `Followed`.

    Args:
        rates, slopes: (pieces, n), electrons a picosecond at each begin, and their change a
            picosecond.
        begins, ends: (pieces,) ps, without gaps; the last end ends it all.
    """
    pieces, stop = begins.size, ends[-1]
    bound = change / math.sqrt(q)
    for n in range(goals.shape[0]):
        now, part = begins[0], 0.0
        last, last_level = 0.0, -1
        for k in range(goals.shape[1]):
            charge, span, electrons, j = 0.0, -1.0, -1, 0
            while j < pieces:
                if ends[j] <= now:
                    j += 1
                    continue
                here, rest = (now, part) if now >= begins[j] else (begins[j], 0.0)
                left = float(ends[j] - here) - rest
                gone = float(here - now) + rest - part
                rate = rates[j, n] + slopes[j, n] * (float(here - begins[j]) + rest)
                x = _full(rate, slopes[j, n], left, goals[n, k] - charge)
                lapse = float(longest) - gone
                if x >= 0.0 and (longest == 0 or x <= lapse):
                    span = max(gone + x + delay, float(shortest))
                    break
                if longest > 0 and lapse <= left:
                    charge += (rate + 0.5 * slopes[j, n] * lapse) * lapse
                    span = float(longest)
                    electrons = _reading(charge, q, shares[n, k]) if shot else int(charge)
                    electrons = min(electrons, q - 1)
                    break
                charge += (rate + 0.5 * slopes[j, n] * left) * left
                j += 1
            if span < 0.0:
                progress[n] = min(charge / goals[n, k], 1.0)
                break
            whole = math.floor(part + span)
            then, then_part = now + np.int64(whole), part + span - whole
            if then > stop or (then == stop and then_part > 0.0):
                progress[n] = 1.0 if electrons < 0 else min(charge / goals[n, k], 1.0)
                break
            exact[n, k] = span
            width[n, k] = _ticks(then, then_part, tick) - _ticks(now, part, tick)
            instant[n, k] = then + (1 if then_part > 0.0 else 0)
            if electrons < 0:
                level[n, k] = levels
                sent[n, k] = change == 0.0 or last <= 0.0 or abs(span - last) > bound * last
                if sent[n, k]:
                    last, last_level = span, -1
            else:
                read = electrons * levels // q
                level[n, k] = read
                around = change * math.sqrt((last_level + 0.5) * levels / q)
                sent[n, k] = change == 0.0 or last_level < 0 or abs(read - last_level) > around
                if sent[n, k]:
                    last, last_level = 0.0, read
            now, part = then + reset, then_part
            count[n] += 1


def follow(
    model: EventModel,
    numbers: Numbers,
    light: Light,
    gain: float,
    pattern: DevicePattern | None,
    stop: int,
    intervals: int,
) -> Followed:
    """Runs the pixels with these numbers of an array from the first instant of `light` to `stop`
    (ps), at most so many intervals each. gain: electrons a second for a unit of light."""
    n, pieces = numbers.size, [p for p in light.pieces if p.start < stop]
    fixed = None if pattern is None else pattern.at(numbers)

    def rate(plane: npt.NDArray[np.float32]) -> Reals:
        electrons = plane.ravel()[numbers].astype(np.float64) * gain
        if fixed is not None:
            electrons = electrons * fixed.gain + fixed.dark
        return electrons / PS

    rates = np.array([rate(p.first) for p in pieces])
    slopes = np.array(
        [
            np.zeros(n) if p.constant else (rate(p.last) - now) / (p.stop - p.start)
            for p, now in zip(pieces, rates, strict=True)
        ]
    )
    begins = np.array([p.start for p in pieces])
    ends = np.array([min(p.stop, stop) for p in pieces])
    followed = Followed(
        np.zeros((n, intervals)),
        np.zeros((n, intervals), np.int64),
        np.zeros((n, intervals), np.int64),
        np.zeros((n, intervals), np.uint16),
        np.zeros((n, intervals), np.bool_),
        np.zeros(n, np.int64),
        np.zeros(n),
    )
    _follow(
        rates, slopes, begins, ends, exact_thresholds(model, numbers, intervals),
        _shares(model, numbers, intervals), model.shot, model.threshold, model.tick,
        model.shortest, model.longest, model.levels, float(model.delay), model.reset,
        float(model.change), followed.exact, followed.width, followed.instant, followed.level,
        followed.sent, followed.count, followed.progress,
    )  # fmt: skip
    return followed


def quantile_error(model: EventModel, numbers: Numbers) -> float:
    """How far the thresholds of interval 0 are from the law's, relative, the worst of these pixels:
    P(Gamma(Q) > x) = exp(-x) sum x^k / k! over k < Q, added up in 60 digits."""
    if not model.shot:
        return 0.0
    q, worst = model.threshold, 0.0
    words = _words(numbers, np.zeros(1, np.uint64), model.seed, Stream.SHOT_NOISE)[0][:, 0]
    with localcontext() as context:
        context.prec = 60
        for word, found in zip(words.tolist(), exact_thresholds(model, numbers, 1)[:, 0].tolist(),
                               strict=True):  # fmt: skip
            x = Decimal(found)
            term = (-x).exp()
            upper = term
            for k in range(1, q):
                term = term * x / k
                upper += term
            # dP/dx = exp(-x) x^(Q-1) / (Q-1)!, the last term of the sum.
            want = 1 - (Decimal(word) + Decimal("0.5")) / 2**32
            worst = max(worst, abs(float((upper - want) / (term * x))))
    return worst
