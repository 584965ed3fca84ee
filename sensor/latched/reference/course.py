"""Light on one pixel in float64: its rate at an instant, and its integral up to another instant.

Light is piecewise linear. Piece i runs from `begins[i]` to `ends[i]` (ps, no gaps), and its rate
from `first[i]` to `last[i]` (electrons a picosecond). Before the first piece, light has the rate of
the start of that piece.
"""

from __future__ import annotations

from numba import njit

from sensor.device.charge import exposure

__all__ = ["first_latch", "integrate", "piece_at", "rate_at"]


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
def rate_at(begins, ends, first, last, i, tick, part):  # type: ignore[no-untyped-def]
    """(rate, slope, end) at the instant tick + part (ps) in piece i: electrons a picosecond, its
    change a picosecond, and the instant up to which both are valid."""
    if i < 0:
        return first[0], 0.0, begins[0]
    if first[i] == last[i]:
        return first[i], 0.0, ends[i]
    slope = (last[i] - first[i]) / (ends[i] - begins[i])
    return max(first[i] + slope * (float(tick - begins[i]) + part), 0.0), slope, ends[i]


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
def first_latch(edges, tick, part):  # type: ignore[no-untyped-def]
    """The first cycle whose latch, edges[c + 1], is not before the instant tick + part; edges.size
    - 1 if there is none."""
    cycles = edges.size - 1
    if part > 0.0:
        tick += 1
    if tick <= edges[0]:
        return 0
    if tick > edges[cycles]:
        return cycles
    c = int((tick - edges[0]) / (float(edges[cycles] - edges[0]) / cycles))
    c = min(max(c, 0), cycles - 1)
    while edges[c + 1] < tick:
        c += 1
    while edges[c] >= tick:
        c -= 1
    return c
