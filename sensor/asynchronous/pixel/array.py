"""An array of asynchronous pixels: light in, firings out, each pixel at its own time.

Time is rescaled to charge: light is piecewise linear, so the charge of an interval is quadratic in
time and its inverse closed form, and shot noise is one Gamma(Q) threshold an interval (see
sensor/latched/pixel/interval.py). A run begins with every pixel empty, at its first instant.

The inner loop takes every pixel from event to event through one piece of light. What a pixel is
between two calls changes only with its own events and at the ends of pieces, never at the end of a
call, so that a run gives the same bits however it is split. An interval under way is computed again
from its last event until it ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import PS
from cosim.compute.cores import cores
from cosim.compute.memory import check_memory
from cosim.compute.stopping import threads
from cosim.errors import InputError
from cosim.light.light import Light, Piece
from sensor.asynchronous.model import EventModel, Firings, least_electrons
from sensor.asynchronous.pixel.closed import (
    LEVEL,
    goal,
    level_law,
    rare_goal,
    rare_reading,
    unit,
    width_law,
)
from sensor.asynchronous.pixel.gamma import poisson_below
from sensor.asynchronous.pixel.stretches import LEAST, RARE, fitting, geometric, stretch
from sensor.device.charge import crossing, exposure, later
from sensor.device.pattern import DevicePattern
from sensor.latched.pixel.interval import NO_TABLE, interval_table

Rates = npt.NDArray[np.float64]
_electrons = njit(cache=True, error_model="numpy", nogil=True)(least_electrons)
TILE: Final = 2048
"""Pixels that are run together; results do not depend on it."""
_BUFFER: Final = 1 << 15
STEP_BYTES: Final = 70
"""Memory that joining and ordering a step's events takes for each: two copies and their order."""
FEWER: Final = (
    "shorten duration, simulate fewer pixels, or send changes alone (sensor.asynchronous.change, 8 "
    "for example)"
)


class AsynchronousPixels:
    """Pixels of an array under a model. The noise of a pixel depends on its number alone.

    Args:
        model: rules of a pixel.
        shape: shape of the array, (H, W).
        gain: photoelectrons a second for a unit of light.
        pattern: pattern of the device, None for a perfect one.
        start: instant at which the run begins, ps.
        most: firings of the whole run beyond which it ends with InputError.
        tile: pixels that are run together.
        numbers: numbers of the pixels that are run, (n,); all if None.
    """

    def __init__(
        self,
        model: EventModel,
        shape: tuple[int, int],
        gain: float,
        pattern: DevicePattern | None = None,
        *,
        start: int = 0,
        most: int = 20_000_000,
        tile: int = TILE,
        numbers: npt.NDArray[np.uint32] | None = None,
    ) -> None:
        self.model, self.shape = model, shape
        self._gain, self._tile, self._most = gain, tile, most
        self._fired = 0
        self._chosen = numbers
        whole = np.arange(shape[0] * shape[1], dtype=np.uint32)
        self._pixels = whole if numbers is None else numbers
        n = self._pixels.size
        fixed = None if pattern is None else pattern.at(self._pixels)
        self._scale: Rates | None = None if fixed is None else fixed.gain
        self._dark: Rates | None = None if fixed is None else fixed.dark
        self._table = interval_table(float(model.threshold)) if model.shot else NO_TABLE
        self._state = (
            np.full(n, start, np.int64), np.zeros(n), np.zeros(n), np.full(n, -1.0),
            np.zeros(n, np.uint64), np.full(n, -1.0), np.zeros(n), np.full(n, -1, np.int64),
            np.full(n, -1, np.int64),
        )  # fmt: skip
        self._known: list[tuple[npt.NDArray[np.float32], Rates]] = []

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        kept = {f"pixels{n}": array.copy() for n, array in enumerate(self._state)}
        return kept | {"fired": np.array(self._fired)}

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        for n, array in enumerate(self._state):
            array[:] = state[f"pixels{n}"]
        self._fired = int(state["fired"])

    def rate(self, plane: npt.NDArray[np.float32]) -> Rates:
        """Electrons a second of every pixel under a plane of light, (n,)."""
        mine = plane.ravel() if self._chosen is None else plane.ravel()[self._chosen]
        if not (mine >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(mine.min()):g}")
        electrons = mine.astype(np.float64) * self._gain
        if self._scale is not None and self._dark is not None:
            electrons = electrons * self._scale + self._dark
        return electrons

    def _rates(self, plane: npt.NDArray[np.float32]) -> Rates:
        """Electrons a picosecond; a plane that two pieces share is computed once."""
        for known, rates in self._known:
            if known is plane:
                return rates
        rates = self.rate(plane) / PS
        self._known = [*self._known[-1:], (plane, rates)]
        return rates

    def step(self, light: Light, start: int, stop: int) -> Firings:
        """Firings after start, up to stop (ps). Raises InputError where they are too many."""
        return self.unordered(light, start, stop).ordered()

    def unordered(self, light: Light, start: int, stop: int) -> Firings:
        """The same in any order."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        parts = []
        for piece in light.pieces:
            if piece.stop > start and piece.start < stop:
                parts += self._piece(piece, min(stop, piece.stop))
        check_memory("the events of a step", STEP_BYTES * sum(len(part) for part in parts), FEWER)
        return Firings.join(parts)

    def _piece(self, piece: Piece, stop: int) -> list[Firings]:
        first = self._rates(piece.first)
        last = first if piece.constant else self._rates(piece.last)
        spans = [(n, min(n + self._tile, first.size)) for n in range(0, first.size, self._tile)]
        if len(spans) == 1:
            return self._run(spans[0], first, last, piece, stop)
        with threads(cores()) as pool:
            tiles = [pool.submit(self._run, span, first, last, piece, stop) for span in spans]
            try:
                return [part for tile in tiles for part in tile.result()]
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                self._most = -1  # what is under way ends at its next full buffer
                raise

    def _run(
        self, span: tuple[int, int], first: Rates, last: Rates, piece: Piece, stop: int
    ) -> list[Firings]:
        """One tile through one piece, buffer by buffer."""
        m, chosen = self.model, slice(*span)
        state = [array[chosen] for array in self._state]  # views: they are written to
        pixels, parts, at = self._pixels[chosen], [], 0
        # A tile fires about once a pixel where only changes are sent: room for that at first.
        room = min(_BUFFER, 2 * (span[1] - span[0]))
        while at < span[1] - span[0]:
            pixel, level = np.empty(room, np.uint32), np.empty(room, np.uint16)
            instant, width = np.empty(room, np.int64), np.empty(room, np.int64)
            exact = np.empty(room)
            at, count, turns = advance(  # type: ignore[call-arg]
                pixels, *state, first[chosen], last[chosen], piece.start, piece.stop, stop,
                self._table, m.shot, m.threshold, np.uint64(m.seed), m.tick, m.shortest, m.longest,
                m.levels, m.delay, m.reset, float(m.change), at, pixel, instant, width, exact,
                level,
            )  # fmt: skip
            n = slice(0, count)
            parts.append(
                Firings(
                    pixel[n].copy(),
                    instant[n].copy(),
                    width[n].copy(),
                    exact[n].copy(),
                    level[n].copy(),
                    turns,
                )
            )
            room = _BUFFER
            self._fired += count
            if self._fired > self._most:
                raise InputError(
                    "the events", f"at most {max(self._most, 0):,}", "more",
                    FEWER,
                )  # fmt: skip
        return parts


@njit(cache=True, error_model="numpy", nogil=True)
def _tick(instant, part, tick):  # type: ignore[no-untyped-def]
    """Ticks that have ended when an instant is latched."""
    whole = instant + (1 if part > 0.0 else 0)
    return -(-whole // tick)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True, error_model="numpy")
def advance(  # type: ignore[no-untyped-def]
    pixels, since, part, charge, goals, spikes, width, sent, sent_level, countdown,
    first_rate, last_rate, begins, ends, stop, table, shot, threshold, seed, tick, shortest,
    longest, levels, delay, reset, change, start, out_pixel, out_instant, out_width, out_exact,
    out_level,
):  # fmt: skip
    """Runs pixels from number `start` of these arrays on until `stop` (ps), at most the end of the
    piece from `begins` to `ends`. Rates: electrons a picosecond at those two instants.

    State of a pixel: since, part: instant its interval began, ps and a fraction.

    Gives (the pixel it got to, events written, turns of the loop): it returns early when the
    buffers are full, to be called again.

    Args:
        charge: electrons gathered before this piece.
        goals: threshold of the interval under way, -1 while not drawn.
        width: ps after which the full pixel fires, -1 while it gathers.
        spikes: index of the interval.
        sent, sent_level: width and level of the last report, 0 and -1 for none.
        countdown: unreported intervals before the next report, -1 while not drawn.
    """
    q = float(threshold)
    relative = change / math.sqrt(q)
    count, work = 0, 0
    room = out_instant.size
    for n in range(start, since.size):
        rate0, rate1 = first_rate[n], last_rate[n]
        steady = rate0 == rate1
        slope = 0.0 if steady else (rate1 - rate0) / (ends - begins)
        pixel = np.uint64(pixels[n])
        known = False
        p, a, b, mean, variance, third = 1.0, 0.0, math.inf, q, q, 2.0 * q
        low, high = 0, 0
        while True:
            work += 1
            if count == room:
                return n, count, work
            began, rest = since[n], part[n]
            if width[n] >= 0.0:
                # Full: it waits for its comparator and its shortest width, whatever the light does.
                now, now_part = later(began, rest, width[n])
                if now > stop or (now == stop and now_part > 0.0):
                    break
                span = width[n]
                if change == 0.0 or sent[n] <= 0.0 or abs(span - sent[n]) > relative * sent[n]:
                    out_pixel[count] = pixels[n]
                    out_instant[count] = now + (1 if now_part > 0.0 else 0)
                    out_width[count] = _tick(now, now_part, tick) - _tick(began, rest, tick)
                    out_exact[count] = span
                    out_level[count] = levels
                    count += 1
                    sent[n], sent_level[n] = span, -1
                    countdown[n], known = -1, False
                else:
                    countdown[n] = max(countdown[n] - 1, -1)
                since[n], part[n] = now + reset, now_part
                charge[n], goals[n], width[n] = 0.0, -1.0, -1.0
                spikes[n] += np.uint64(1)
                continue
            if began >= ends:
                break
            here, here_part = (began, rest) if began >= begins else (begins, 0.0)
            left = float(ends - here) - here_part
            gone = float(here - began) + here_part - rest
            target, forced = goals[n], -1
            if target < 0.0:
                if not known:
                    a, b = 0.0, math.inf
                if change > 0.0 and steady and sent[n] > 0.0:
                    if not known:
                        p, a, b, mean, variance, third = width_law(
                            q, shot, rate0, delay, shortest, longest,
                            sent[n] * (1.0 - relative), sent[n] * (1.0 + relative),
                        )  # fmt: skip
                        known = True
                    if p <= RARE:
                        if countdown[n] < 0:
                            countdown[n] = geometric(p, pixel, spikes[n], seed)
                        period = mean / rate0 + delay + reset
                        many = min(countdown[n], fitting(left, period, math.sqrt(variance) / rate0))
                        # Without noise a stretch of any length is exact, and of no concern
                        # until the light changes.
                        if not shot and stop < ends:
                            break
                        if many >= LEAST or (not shot and many > 0):
                            held = max(a, rate0 * (shortest - delay))
                            span = stretch(
                                many, mean, variance, third, held, pixel, spikes[n], seed
                            )
                            span = span / rate0 + many * float(delay + reset)
                            now, now_part = later(began, rest, span)
                            if now > stop or (now == stop and now_part > 0.0):
                                break
                            since[n], part[n] = now, now_part
                            spikes[n] += np.uint64(many)
                            countdown[n] -= many
                            continue
                        if countdown[n] == 0:
                            target = rare_goal(q, a, b, p, pixel, spikes[n], seed)
                    else:
                        a, b = 0.0, math.inf
                elif change > 0.0 and steady and sent_level[n] >= 0 and longest <= left:
                    a, b = 0.0, math.inf
                    if not known:
                        around = change * math.sqrt((sent_level[n] + 0.5) * levels / q)
                        low = _electrons(
                            max(math.ceil(sent_level[n] - around), 0), threshold, levels
                        )
                        most = min(math.floor(sent_level[n] + around), levels - 1)
                        high = _electrons(most + 1, threshold, levels) - 1
                        p = level_law(q, shot, rate0 * longest, low, high)
                        known = True
                    if p <= RARE:
                        if countdown[n] < 0:
                            countdown[n] = geometric(p, pixel, spikes[n], seed)
                        ceiling = began + (1 if rest > 0.0 else 0)
                        many = (stop - ceiling - longest) // (longest + reset) + 1
                        many = min(countdown[n], max(many, 0))
                        if many > 0:
                            since[n] += many * (longest + reset)
                            spikes[n] += np.uint64(many)
                            countdown[n] -= many
                            continue
                        if countdown[n] > 0:
                            break
                        forced, target = rare_reading(
                            q, rate0 * longest, low, high, pixel, spikes[n], seed
                        )
                if target < 0.0:
                    target = goal(table, shot, q, pixel, spikes[n], seed, a, b)
            rate = rate0 if steady else rate0 + slope * (float(here - begins) + here_part)
            x = crossing(max(rate, 0.0), slope, target - charge[n])
            lapse = float(longest) - gone
            if x <= left and (longest == 0 or x <= lapse):
                width[n] = max(gone + x + delay, float(shortest))
                continue
            if longest > 0 and lapse <= left:
                now = began + longest
                if now > stop or (now == stop and rest > 0.0):
                    break
                total = charge[n] + exposure(max(rate, 0.0), slope, lapse)
                if not shot:
                    forced = min(int(total), threshold - 1)
                elif forced < 0:
                    u = unit(pixel, spikes[n], np.uint64(0), seed, LEVEL)
                    forced = poisson_below(total, threshold, u)
                level = forced * levels // threshold
                around = change * math.sqrt((sent_level[n] + 0.5) * levels / q)
                if change == 0.0 or sent_level[n] < 0 or abs(level - sent_level[n]) > around:
                    out_pixel[count] = pixels[n]
                    out_instant[count] = now + (1 if rest > 0.0 else 0)
                    out_width[count] = _tick(now, rest, tick) - _tick(began, rest, tick)
                    out_exact[count] = float(longest)
                    out_level[count] = level
                    count += 1
                    sent[n], sent_level[n] = 0.0, level
                    countdown[n], known = -1, False
                else:
                    countdown[n] = max(countdown[n] - 1, -1)
                since[n] = now + reset
                charge[n], goals[n] = 0.0, -1.0
                spikes[n] += np.uint64(1)
                continue
            if stop == ends:
                charge[n] += exposure(max(rate, 0.0), slope, left)
                goals[n] = target
            break
        if stop == ends:
            countdown[n] = -1
    return since.size, count, work
