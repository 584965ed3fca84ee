"""Light on one pixel in float64: its rate at an instant, and its integral up to another instant.

Light is piecewise linear. Piece i runs from `begins[i]` to `ends[i]` (ps, no gaps), and its rate
from `first[i]` to `last[i]` (electrons a picosecond). Before the first piece, light has the rate of
the start of that piece.
"""

from __future__ import annotations

from numba import njit

from sensor.device.charge import exposure

_SAME = 2.0**-50
"""Relative tolerance within which an instant counts as at a latch."""
_INSTANT = 2.0**-20
"""Rounding error of an instant in picoseconds, independent of the interval."""


@njit(cache=True, error_model="numpy", nogil=True)
def piece_at(begins, ends, i, tick):  # type: ignore[no-untyped-def]
    """Index of the piece at `tick` (ps), searched from piece i on; -1 before the first piece."""
    if tick < begins[0]:
        return -1
    i = max(i, 0)
    while i < ends.size - 1 and ends[i] <= tick:
        i += 1
    return i


@njit(cache=True, error_model="numpy", nogil=True)
def slope_on(begins, ends, first, last, i):  # type: ignore[no-untyped-def]
    """(slope, end) of piece i: change of its rate, electrons a picosecond a picosecond, and the
    instant up to which it is valid."""
    if i < 0:
        return 0.0, begins[0]
    if first[i] == last[i]:
        return 0.0, ends[i]
    return (last[i] - first[i]) / (ends[i] - begins[i]), ends[i]


@njit(cache=True, error_model="numpy", nogil=True)
def rate_on(begins, first, slope, i, tick, part):  # type: ignore[no-untyped-def]
    """Rate at the instant tick + part (ps) in piece i of this slope, electrons a picosecond."""
    if slope == 0.0:
        return first[max(i, 0)]
    return max(first[i] + slope * (float(tick - begins[i]) + part), 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def rate_at(begins, ends, first, last, i, tick, part):  # type: ignore[no-untyped-def]
    """(rate, slope, end) at the instant tick + part (ps) in piece i; see `slope_on`."""
    slope, end = slope_on(begins, ends, first, last, i)
    return rate_on(begins, first, slope, i, tick, part), slope, end


@njit(cache=True, error_model="numpy", nogil=True)
def integrate(begins, ends, first, last, i, tick, part, until):  # type: ignore[no-untyped-def]
    """Electrons from the instant tick + part (ps) in piece i to a later whole picosecond."""
    total = 0.0
    while tick < until:
        i = piece_at(begins, ends, i, tick)
        rate, slope, end = rate_at(begins, ends, first, last, i, tick, part)
        stop = until if end < tick + 1 or until < end else end  # the last piece runs on
        total += exposure(rate, slope, float(stop - tick) - part)
        tick, part = stop, 0.0
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def often(edges):  # type: ignore[no-untyped-def]
    """Mean number of latches a picosecond."""
    return (edges.size - 1) / float(edges[edges.size - 1] - edges[0])


@njit(cache=True, error_model="numpy", nogil=True)
def first_latch(edges, rate, tick, part):  # type: ignore[no-untyped-def]
    """The first cycle whose latch, edges[c + 1], is not before the instant tick + part; edges.size
    - 1 if there is none. rate: `often` of the edges."""
    cycles = edges.size - 1
    if part > 0.0:
        tick += 1
    if tick <= edges[0]:
        return 0
    if tick > edges[cycles]:
        return cycles
    c = min(int((tick - edges[0]) * rate), cycles - 1)
    while edges[c + 1] < tick:
        c += 1
    while edges[c] >= tick:
        c -= 1
    return c


@njit(cache=True, error_model="numpy", nogil=True)
def latched(edges, rate, tick, part, span):  # type: ignore[no-untyped-def]
    """The instant tick + part, moved to a latch within the rounding error of `span` (ps), and its
    `first_latch`: (tick, part, cycle)."""
    near = tick + 1 if part > 0.5 else tick
    c = first_latch(edges, rate, near, 0.0)
    if c < edges.size - 1 and edges[c + 1] == near:
        away = abs(part - 1.0) if part > 0.5 else part
        if away <= span * _SAME + _INSTANT:
            return near, 0.0, c
        if part <= 0.5:  # just beyond this latch
            c += 1
    return tick, part, c
