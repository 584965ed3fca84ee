"""The inner loop: every pixel from event to event through one piece of light.

What a pixel is between two calls changes only with its own events and at the ends of pieces, never
at the end of a call, so that a run gives the same bits however it is split. An interval under way
is computed again from its last event until it ends.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sensor.asynchronous.model import least_electrons
from sensor.asynchronous.pixel.gamma import poisson_below
from sensor.asynchronous.pixel.interval import (
    LEVEL,
    goal,
    level_law,
    rare_goal,
    rare_reading,
    unit,
    width_law,
)
from sensor.asynchronous.pixel.skipping import LEAST, RARE, fitting, geometric, stretch
from sensor.device.charge import crossing, exposure, later


@njit(cache=True, error_model="numpy", nogil=True)
def _tick(instant, part, tick):  # type: ignore[no-untyped-def]
    """Ticks that have ended when an instant is latched."""
    whole = instant + (1 if part > 0.0 else 0)
    return -(-whole // tick)


_electrons = njit(cache=True, error_model="numpy", nogil=True)(least_electrons)


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
