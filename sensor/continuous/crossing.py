"""Monitors of a continuous camera, and their reports without noise: from one crossing to the next
in closed form.

Under a photocurrent that runs as i(t) = i0 + k t the one-pole filter's current is
m(t) = i0 + k t - k tau + C e^(-t/tau), C = m(0) - i0 + k tau. It turns at most once, so each part
between its turn and the ends is monotone and crosses reference +- threshold at most once: with
k = 0 at t = tau ln(C / (L - i0)), else by Newton's method held inside its bracket.

All is reckoned from the anchor, the start of the piece of light, never from where a run is split.
Instants are rounded to picoseconds; a crossing found before the end of one piece that rounds to
its end is found again in the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt
from numba import njit

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
CHUNK = 256
"""Pixels whose reports share one buffer, and one task of a processor core."""
_PS = 1e12


@dataclass(frozen=True, eq=False)
class Monitors:
    """One value per pixel.

    Attributes:
        current: filtered photocurrent, electrons/s.
        reference: value of the last report, NaN before the first.
        when: instant from which the comparator is active, or at which the running measurement began
            (without noise: picoseconds) or ends (sampled: tick).
        measuring: 1 during a measurement.
        charge: charge of the measurement so far, electrons.
    """

    current: Floats
    reference: Floats
    when: Ints
    measuring: npt.NDArray[np.uint8]
    charge: Floats

    @classmethod
    def fresh(cls, current: Floats, when: int) -> Monitors:
        """Before the first report."""
        n = current.size
        return cls(
            current.copy(), np.full(n, np.nan), np.full(n, when, np.int64), np.zeros(n, np.uint8),
            np.zeros(n),
        )  # fmt: skip

    def copy(self) -> Monitors:
        return Monitors(*(getattr(self, f.name).copy() for f in fields(self)))


@dataclass(frozen=True, eq=False)
class Reports:
    """Reports in no particular order, each array (n,).

    Attributes:
        pixel: place in the plane.
        tick: tick of the report.
        value: photocurrent before the converter, electrons/s.
    """

    pixel: Ints
    tick: Ints
    value: Floats


def collect(kernel: Kernel, monitors: Monitors, room: int) -> tuple[Monitors, Reports, int]:
    """Monitors after the kernel, their reports, and the room that was needed. Where a chunk had
    more reports than room, all is done again with enough."""
    chunks = -(-monitors.current.size // CHUNK)
    while True:
        after, counts = monitors.copy(), np.zeros(chunks, np.int64)
        pixel, tick = (np.empty((chunks, room), np.int64) for _ in range(2))
        value = np.empty((chunks, room))
        kernel(after, counts, pixel, tick, value)
        most = int(counts.max())
        if most <= room:
            there = np.arange(room) < counts[:, None]
            return after, Reports(pixel[there], tick[there], value[there]), room
        room = 1 << (most - 1).bit_length()


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def jump(  # type: ignore[no-untyped-def]
    chunk0, chunk1, current, reference, when, measuring, charge, first, slope, gain, dark, anchor,
    stop, until, grid, tau, contrast, floor, measure, dead, counts, pixels, ticks, values,
):  # fmt: skip
    """Carries monitors through one piece of light from `anchor` to `stop`, of which the part up to
    `until` is due (ps): reports before it are written, and where it is `stop`, `current` and
    `charge` move there.

    Args:
        chunk0, chunk1: chunks of CHUNK monitors to carry, first and stop.
        first: light at the anchor, slope: its change a second (n,).
        gain: electrons/s for a unit of light, dark: electrons/s (n,).
        measure, dead: ps.
        counts, pixels, ticks, values: `Reports` by chunk.
    """
    length = (stop - anchor) / _PS
    room = pixels.shape[1]
    for chunk in range(chunk0, chunk1):
        n = 0
        for p in range(chunk * CHUNK, min((chunk + 1) * CHUNK, current.size)):
            i0, k = gain[p] * first[p] + dark[p], gain[p] * slope[p]
            m = current[p]
            c = m - i0 + k * tau
            while True:
                r = reference[p]
                if measuring[p]:
                    t = when[p] + measure
                    if t >= until:
                        break
                    s, e = (max(when[p], anchor) - anchor) / _PS, (t - anchor) / _PS
                    value = charge[p] + (i0 + 0.5 * k * (s + e)) * (e - s)
                    value /= measure / _PS
                else:
                    looks = max(when[p], anchor)
                    if looks >= until:
                        break
                    t, value = looks, 0.0
                    threshold = max(contrast * r, floor)
                    s = (looks - anchor) / _PS
                    if math.isnan(r):
                        value = _course(s, i0, k, c, tau)
                    elif k == 0 and c == 0 and abs(m - r) < threshold:
                        break
                    else:
                        at, value = _first(s, length, i0, k, c, tau, r, threshold)
                        if at >= (until - anchor) / _PS:
                            break
                        t = max(looks, anchor + np.int64(np.rint(at * _PS)))
                        if t >= until:
                            break
                    if measure > 0:
                        measuring[p], when[p], charge[p] = 1, t, 0.0
                        continue
                tick = tick_of(t, grid)
                if n < room:
                    pixels[chunk, n], ticks[chunk, n], values[chunk, n] = p, tick, value
                n += 1
                reference[p] = max(value, 0.0)
                measuring[p], charge[p] = 0, 0.0
                when[p] = max(t + dead, edge(tick + 1, grid))
            if until == stop:
                if measuring[p]:
                    s = (max(when[p], anchor) - anchor) / _PS
                    charge[p] += (i0 + 0.5 * k * (s + length)) * (length - s)
                if k != 0 or c != 0:
                    current[p] = _course(length, i0, k, c, tau)
        counts[chunk] = n


@njit(cache=True, nogil=True)
def _first(s, stop, i0, k, c, tau, reference, threshold):  # type: ignore[no-untyped-def]
    """(instant, level) of the first crossing in s .. stop, seconds from the anchor; instant is
    infinite where there is none. A change that is already there counts at s."""
    now = _course(s, i0, k, c, tau)
    if not abs(now - reference) < threshold:
        return s, now
    if k == 0:
        if abs(i0 - reference) <= threshold:
            return math.inf, 0.0
        level = reference + math.copysign(threshold, i0 - reference)
        return max(s, tau * math.log(c / (level - i0))), level
    turn = math.inf
    if c * k > 0:
        turn = tau * math.log(c / (k * tau))
    lo = s
    for part in range(2):
        hi = min(turn, stop) if part == 0 else stop
        if hi <= lo:
            continue
        off = _course(hi, i0, k, c, tau) - reference
        if abs(off) >= threshold:
            level = reference + math.copysign(threshold, off)
            return _solve(level, lo, hi, i0, k, c, tau), level
        lo = hi
    return math.inf, 0.0


@njit(cache=True, nogil=True)
def _solve(level, lo, hi, i0, k, c, tau):  # type: ignore[no-untyped-def]
    """Where the course, monotone from lo to hi, has `level`, which lies between its ends."""
    rising = _course(hi, i0, k, c, tau) > _course(lo, i0, k, c, tau)
    t = 0.5 * (lo + hi)
    for _ in range(200):
        decay = c * math.exp(-t / tau)
        off = i0 + k * (t - tau) + decay - level
        if off == 0:
            break
        if (off > 0) == rising:
            hi = t
        else:
            lo = t
        slope = k - decay / tau
        guess = t - off / slope if slope != 0 else lo
        if not lo < guess < hi:
            guess = 0.5 * (lo + hi)
        if abs(guess - t) <= 1e-16 * abs(t) or guess in (lo, hi):
            return guess
        t = guess
    return t


@njit(cache=True, nogil=True)
def _course(t, i0, k, c, tau):  # type: ignore[no-untyped-def]
    return i0 + k * (t - tau) + c * math.exp(-t / tau)


@njit(cache=True, nogil=True)
def edge(tick, grid):  # type: ignore[no-untyped-def]
    """Start of a tick in ps. grid: (a tick, its edge, remainder there, numerator, denominator) of
    ps = floor(tick x numerator / denominator)."""
    return grid[1] + (grid[2] + (tick - grid[0]) * grid[3]) // grid[4]


@njit(cache=True, nogil=True)
def tick_of(ps, grid):  # type: ignore[no-untyped-def]
    """The tick that holds an instant: the last whose edge is not after it."""
    return grid[0] + ((ps - grid[1] + 1) * grid[4] - 1 - grid[2]) // grid[3]


Kernel = Callable[[Monitors, Ints, Ints, Ints, Floats], None]
"""(monitors, changed in place; counts (chunks,); pixel, tick, value (chunks, room)). Counts all
reports of a chunk, writes those there is room for."""
