"""Pixels under steady light that send once: their first width in closed form, and nothing after it.

With a rule of changes a pixel under steady light sends its first width and then only what is far
from it. Where that is never, or too seldom to matter (`effects.py`, "later reports"), a pixel is
one draw and one quotient. The arithmetic is the engine's for an interval that begins with the run,
so the spikes that both send agree to the last bit.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import PS
from cosim.compute.philox_compiled import random_words, word_at
from cosim.compute.streams import Stream
from cosim.light.light import Light
from cosim.light.steps import is_steady
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.gamma import inverse_lower, inverse_upper, poisson_outside, tails
from sensor.asynchronous.pixel.stretches import SKIP, interval_moments
from sensor.device.charge import later
from sensor.device.pattern import DevicePattern
from sensor.latched.pixel.draws import look_up
from sensor.latched.pixel.interval import NO_TABLE, interval_table

Reals = npt.NDArray[np.float64]
LEVEL: Final = np.uint64(Stream.READING)
_SHOT: Final = np.uint64(Stream.SHOT_NOISE)
_ONE: Final = 2.0**-40
_NEVER: Final = 1e300
_SCALE: Final = 2.0**-32


class ClosedPixels:
    """Pixels with these numbers of an array of `shape`, as `AsynchronousPixels`, but for what they
    send after their first spike.

    Raises ValueError for a model with a longest width or without a rule of changes, whose pixels
    send more.
    """

    def __init__(
        self,
        model: EventModel,
        shape: tuple[int, int],
        gain: float,
        pattern: DevicePattern | None,
        numbers: npt.NDArray[np.uint32],
        *,
        start: int = 0,
    ) -> None:
        if model.longest or not model.change:
            raise ValueError("pixels that send once must have change > 0 and no longest width")
        self.model, self.shape = model, shape
        self._gain, self._numbers, self._start = gain, numbers, start
        fixed = None if pattern is None else pattern.at(numbers)
        self._scale = np.ones(1) if fixed is None else fixed.gain
        self._dark = np.zeros(1) if fixed is None else fixed.dark
        self._table = interval_table(float(model.threshold)) if model.shot else NO_TABLE

    def unordered(self, light: Light, start: int, stop: int) -> Firings:
        """First spikes after start, up to stop (ps), in the order of the pixels' numbers. Raises
        ValueError for light that is not steady since the run began."""
        m, n = self.model, self._numbers.size
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if light.pieces[0].start > self._start or not is_steady(light, stop):
            raise ValueError("light must be steady from the first instant on")
        plane = light.pieces[0].first
        if not (plane >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(plane.min()):g}")
        pixel, exact = np.empty(n, np.uint32), np.empty(n)
        instant, width = np.empty(n, np.int64), np.empty(n, np.int64)
        count = _first(
            self._numbers, plane.ravel(), self._gain, self._scale, self._dark,
            self._table, m.shot, m.threshold, np.uint64(m.seed), m.tick, m.shortest, m.delay,
            self._start, start, stop, pixel, instant, width, exact,
        )  # fmt: skip
        level = np.full(count, m.levels, np.uint16)
        return Firings(pixel[:count], instant[:count], width[:count], exact[:count], level, n)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True, error_model="numpy")
def _first(  # type: ignore[no-untyped-def]
    numbers, plane, gain, scale, dark, table, shot, threshold, seed, tick, shortest, delay, begins,
    start, stop, out_pixel, out_instant, out_width, out_exact,
):  # fmt: skip
    """Writes the first spikes that fall after start, up to stop; their number.

    Args:
        plane: (pixels of the array,).
        scale, dark: (n,) or (1,).
    """
    q, count = float(threshold), 0
    infinite, each, dim = np.inf, scale.size > 1, dark.size > 1
    for n in range(numbers.size):
        rate = np.float64(plane[numbers[n]]) * gain
        rate = (rate * scale[n if each else 0] + dark[n if dim else 0]) / PS
        if rate <= 0.0:
            continue
        pixel = np.uint64(numbers[n])
        target = goal(table, shot, q, pixel, np.uint64(0), seed, 0.0, infinite)
        span = max(target / rate + delay, float(shortest))
        if span > stop - begins + 1.0:
            continue
        now, part = later(begins, 0.0, span)
        edge = now + (1 if part > 0.0 else 0)
        if edge <= start or edge > stop:
            continue
        out_pixel[count] = numbers[n]
        out_instant[count] = edge
        out_width[count] = -(-edge // tick) - -(-begins // tick)
        out_exact[count] = span
        count += 1
    return count


@njit(cache=True, error_model="numpy", nogil=True)
def unit(pixel, index, draw, seed, stream):  # type: ignore[no-untyped-def]
    """A number in (0, 1) of 64 random bits."""
    w0, w1, _, _ = random_words(pixel, index, draw, seed, stream)
    return min((float(w0) + (float(w1) + 0.5) * _SCALE) * _SCALE, 1.0 - 2.0**-53)


@njit(cache=True, error_model="numpy", nogil=True)
def goal(table, shot, q, pixel, k, seed, low, high):  # type: ignore[no-untyped-def]
    """Threshold of interval k in electrons, drawn again until it lies within low .. high."""
    if not shot:
        return q
    drawn = look_up(table, word_at(pixel, k, np.uint64(0), seed, _SHOT)) * _ONE
    again = np.uint64(1)
    while not low <= drawn <= high and again < np.uint64(1000):
        word = random_words(pixel, k, again, seed, SKIP)[0]
        drawn = look_up(table, word) * _ONE
        again += np.uint64(1)
    return drawn


@njit(cache=True, error_model="numpy", nogil=True)
def width_law(q, shot, rate, delay, shortest, longest, least, most):  # type: ignore[no-untyped-def]
    """How an interval under a steady rate goes that is unreported while its width lies within
    least .. most: (p of a report, bounds a and b of its threshold, mean, variance and third moment
    of max(threshold, what the shortest width lets in), all in electrons)."""
    held = max(rate * (shortest - delay), 0.0)
    a = 0.0 if least <= shortest else max(rate * (least - delay), 0.0)
    b = rate * (most - delay)
    if longest > 0:
        b = min(b, rate * longest)
    if not shot:
        inside = a <= q <= b
        return (0.0 if inside else 1.0), a, b, max(q, held), 0.0, 0.0
    p = tails(q, a)[0] + tails(q, b)[1]
    if p > 0.5:
        return p, a, b, q, q, 2.0 * q
    mean, variance, third = interval_moments(q, a, b, held)
    return p, a, b, mean, variance, third


@njit(cache=True, error_model="numpy", nogil=True)
def level_law(q, shot, mean, low, high):  # type: ignore[no-untyped-def]
    """Probability that the electrons of a longest width are below `low` or above `high`."""
    if not shot:
        return 0.0 if low <= math.floor(mean) <= high else 1.0
    left = tails(float(low), mean)[1] if low > 0 else 0.0
    return left + tails(high + 1.0, mean)[0]


@njit(cache=True, error_model="numpy", nogil=True)
def rare_goal(q, a, b, p, pixel, k, seed):  # type: ignore[no-untyped-def]
    """A threshold outside a .. b: the interval that is reported at last."""
    lower, upper = tails(q, a)[0], tails(q, b)[1]
    u = unit(pixel, k, np.uint64(2000), seed, SKIP) * (lower + upper)
    if u < lower:
        return inverse_lower(q, a, math.log(max(u, 1e-300)))
    return inverse_upper(q, b, math.log(max(u - lower, 1e-300)))


@njit(cache=True, error_model="numpy", nogil=True)
def rare_reading(q, mean, low, high, pixel, k, seed):  # type: ignore[no-untyped-def]
    """Electrons outside low .. high at the end of a longest width, and the threshold: (below q,
    one never reached) for a reading, (q, threshold) for a spike."""
    u = unit(pixel, k, np.uint64(2000), seed, SKIP)
    electrons = poisson_outside(mean, low, high, int(q), u)
    if electrons < q:
        return electrons, _NEVER
    u = unit(pixel, k, np.uint64(2001), seed, SKIP)
    return electrons, inverse_lower(q, mean, math.log(u) + math.log(tails(q, mean)[0]))
