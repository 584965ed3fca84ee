"""Likelihood of spikes and its derivatives, compiled loops over single bits, on all cores.

The kernels take plain arrays and numbers: numba compiles them once for these types, while the
callers pass their fields from different records.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.special import ndtr

from cosim.compute.cores import by_rows

Floats = npt.NDArray[np.float64]
Bits = npt.NDArray[np.uint8]


_ROOT, _DENSITY = 1 / math.sqrt(2), 1 / math.sqrt(2 * math.pi)
_FAR = 5.0
"""Standard deviations beyond which a probability is 0 or 1: it is 3e-7 there, and the floor is
2e-2."""
_CERTAIN, _NODES = 7.0, 256
"""_CERTAIN: standard deviations beyond which the integral of the normal distribution function is a
straight line to 1e-12. _NODES: nodes of its table in one; its Taylor series of second order from
the nearest errs by 4e-10 at most, and takes a tenth of the time of the functions of the C
library."""
_Z = np.arange(-_CERTAIN * _NODES, _CERTAIN * _NODES + 1) / _NODES
_NORMAL, _SHARE = _DENSITY * np.exp(-_Z * _Z / 2), ndtr(_Z)
_RAMP = _Z * _SHARE + _NORMAL


@njit(inline="always", nogil=True)
def _part(tick, start, period):  # type: ignore[no-untyped-def]
    """Symbol in which a tick begins, and the part of the tick after that symbol's end."""
    at = (tick - start) / period
    whole = math.floor(at)
    return int(whole), (at - whole) * period + 1 - period


@njit(inline="always", nogil=True)
def _log_likelihood(z, floor, sure, never):  # type: ignore[no-untyped-def]
    """ln of the probability at z standard deviations on the observed side."""
    if z > _FAR:
        return sure
    if z < -_FAR:
        return never
    return math.log(floor + (1 - 2 * floor) * 0.5 * math.erfc(-z * _ROOT))


@njit(inline="always", nogil=True)
def _left(charge, rule):  # type: ignore[no-untyped-def]
    """Charge after a spike."""
    if rule == 1:
        return 0.0
    rest = max(charge - 1, 0.0)
    return rest - math.floor(rest) if rule == 0 else rest


def likelihood(
    bits: Bits, light: Floats, start: Floats, tick: int, period: float, on: float,
    background: float, rule: int, noise: float, floor: float, skip: int,
) -> Floats:  # fmt: skip
    """ln P of the observed bits of each pixel, (n,).

    Args:
        bits: (n, ticks) uint8.
        light: (n, symbols) float64, light of each symbol on each pixel.
        start: (n,) tick at which symbol 0 begins.
        tick: tick of the first bit.
        period: ticks of a symbol.
        on, background: charge of a tick of full light, and of the background, thresholds.
        rule: rule of the reset, 0 residual, 1 hard, 2 subtract.
        noise: standard deviation of the charge at a spike, thresholds.
        floor: smallest probability.
        skip: ticks before the first that counts.
    """
    bits, light = np.ascontiguousarray(bits), np.ascontiguousarray(light)  # compiled once
    out = np.empty(len(bits))
    by_rows(
        _likelihood, len(bits), bits, light, start, tick, period, on, background, rule, noise,
        floor, skip, out,
    )  # fmt: skip
    return out


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def _likelihood(  # type: ignore[no-untyped-def]
    i0, i1, bits, light, start, tick, period, on, background, rule, noise, floor, skip, out
):
    ticks, symbols = bits.shape[1], light.shape[1]
    sure, never = math.log(1 - floor), math.log(floor)
    for i in range(i0, i1):
        charge = 0.5
        total = 0.0
        for k in range(ticks):
            whole, share = _part(tick + k, start[i], period)
            share = min(max(share, 0.0), 1.0)
            n = min(max(whole, 0), symbols - 1)
            m = min(n + 1, symbols - 1)
            charge += on * ((1 - share) * light[i, n] + share * light[i, m]) + background
            fired = bits[i, k] != 0
            if k >= skip:
                z = (charge - 1) / noise
                total += _log_likelihood(z if fired else -z, floor, sure, never)
            if fired:
                charge = _left(charge, rule)
            elif charge > 1:
                charge = 1.0
        out[i] = total


def slopes(
    bits: Bits, light: Floats, start: Floats, tick: int, period: float, on: float,
    background: float, rule: int, noise: float, floor: float, skip: int,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """ln P as `likelihood`, (n,), its derivatives, (n, 4), and the Fisher information, (n, 4, 4).

    The four parameters are the delay of the symbols, ticks; the same times the number of the symbol
    that begins; light; background. Between spikes the charge of a pixel is linear in all of them.
    """
    bits, light = np.ascontiguousarray(bits), np.ascontiguousarray(light)
    count = len(bits)
    out, first, second = np.zeros(count), np.zeros((count, 4)), np.zeros((count, 4, 4))
    by_rows(
        _slopes, count, bits, light, start, tick, period, on, background, rule, noise, floor, skip,
        out, first, second,
    )  # fmt: skip
    return out, first, second


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def _slopes(  # type: ignore[no-untyped-def]
    i0, i1, bits, light, start, tick, period, on, background, rule, noise, floor, skip,
    out, first, second,
):  # fmt: skip
    ticks, symbols = bits.shape[1], light.shape[1]
    by = np.empty(4)
    sure, never = math.log(1 - floor), math.log(floor)
    for i in range(i0, i1):
        charge = 0.5
        by[0] = by[1] = by[2] = by[3] = 0.0
        for k in range(ticks):
            whole, share = _part(tick + k, start[i], period)
            n = min(max(whole, 0), symbols - 1)
            m = min(n + 1, symbols - 1)
            if 0.0 < share < 1.0:
                swing = on * (light[i, n] - light[i, m])
                by[0] += swing
                by[1] += swing * (whole + 1)
            share = min(max(share, 0.0), 1.0)
            lit = (1 - share) * light[i, n] + share * light[i, m]
            charge += on * lit + background
            by[2] += lit
            by[3] += 1.0
            fired = bits[i, k] != 0
            if k >= skip:
                z = (charge - 1) / noise
                out[i] += _log_likelihood(z if fired else -z, floor, sure, never)
                if -_FAR < z < _FAR:
                    p = floor + (1 - 2 * floor) * 0.5 * math.erfc(-z * _ROOT)
                    rise = (1 - 2 * floor) * _DENSITY * math.exp(-z * z / 2) / noise
                    steep = rise / p if fired else -rise / (1 - p)
                    weight = rise * rise / (p * (1 - p))
                    for a in range(4):
                        first[i, a] += steep * by[a]
                        for b in range(a + 1):
                            second[i, a, b] += weight * by[a] * by[b]
            if fired:
                rest = _left(charge, rule)
                if rest == 0.0:
                    by[0] = by[1] = by[2] = by[3] = 0.0
                charge = rest
            elif charge > 1:
                charge = 1.0
                by[0] = by[1] = by[2] = by[3] = 0.0
        for a in range(4):
            for b in range(a):
                second[i, b, a] = second[i, a, b]


@njit(inline="always", nogil=True)
def _ramp(z):  # type: ignore[no-untyped-def]
    """Integral of the normal distribution function up to z, from the nearest node."""
    if abs(z) >= _CERTAIN:
        return max(z, 0.0)
    n = int((z + _CERTAIN) * _NODES + 0.5)
    off = z - (n / _NODES - _CERTAIN)
    return _RAMP[n] + off * (_SHARE[n] + off / 2 * _NORMAL[n])


def overlap(distance: Floats, blur: float, side: float) -> Floats:
    """Light along one axis between camera pixels and panel pixels at distances, (n, k).

    It is the convolution of a box of 1, a box of `side` and a Gaussian of standard deviation
    `blur`.
    """
    out = np.empty(distance.shape)
    by_rows(_overlap, len(distance), distance, blur, side, out)
    return out


@njit(cache=True, nogil=True)
def _overlap(i0, i1, distance, blur, side, out):  # type: ignore[no-untyped-def]
    wide, narrow = (1 + side) / 2, (1 - side) / 2
    for i in range(i0, i1):
        for k in range(distance.shape[1]):
            d = distance[i, k]
            value = _ramp((d + wide) / blur) - _ramp((d + narrow) / blur)
            value += _ramp((d - wide) / blur) - _ramp((d - narrow) / blur)
            out[i, k] = value * blur / side
