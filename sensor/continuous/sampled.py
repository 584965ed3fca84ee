"""Monitors under shot noise: an Ornstein-Uhlenbeck process, exact from tick to tick.

Electrons arrive as a Poisson process of rate i(t); a one-pole filter makes of it a current y. With
many electrons in a time constant (i tau >> 1) the arrivals are i dt + sqrt(i) dW, and
dy = (i - y)/tau dt + sqrt(i)/tau dW. Over a tick h, with a = e^(-h/tau), this is normal and exact
(Gillespie, Phys. Rev. E 54:2084, 1996): y -> a y + c + sqrt(v) xi, with

    c = (1/tau) int e^(-(h-s)/tau) i(s) ds,  v = (1/tau^2) int e^(-2(h-s)/tau) i(s) ds,

closed forms for linear i. In steady light v/(1 - a^2) = i/(2 tau): Campbell's theorem. The
electrons themselves that arrive in the tick, g = int i(s) ds of them on the mean and with that
variance, have covariance c with y; a measurement counts g + (c/v) (sqrt(v) xi) +
sqrt(g - c^2/v) eta.

A normal number, drawn inside the compiled loops, is the quantile of one 32-bit word w of
Philox4x32-10 at (w + 1/2) / 2^32, so it lies within 6.4 standard deviations. Quantile: Wichura,
"Algorithm AS 241: the percentage points of the normal distribution", Applied Statistics 37:477,
1988 (PPND16, relative error 1e-16); its third branch, for probabilities below 1.4e-11, is never
reached. Between the 2 % at either end a table of quantiles with straight lines between them is
within 3e-5 of that and several times faster.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.philox_compiled import pick, random_words, word_at
from cosim.compute.streams import Stream
from sensor.continuous.crossing import CHUNK

_CELL_BITS = 21
_CELLS = 1 << (32 - _CELL_BITS)
_TAIL = _CELLS // 50
_SHIFT, _INSIDE = np.uint64(_CELL_BITS), np.uint64((1 << _CELL_BITS) - 1)
FILTER, MEASURED, INITIAL = 0, 1, 2
"""Fourth word of the counter: the monitor's noise, the rest of a measurement's, the initial
current."""
_STREAM = np.uint64(Stream.CONTINUOUS)
_FILTER, _MEASURED, _INITIAL = np.uint64(FILTER), np.uint64(MEASURED), np.uint64(INITIAL)


@njit(cache=True, nogil=True)
def stationary(mean, number, tau, seed, table):  # type: ignore[no-untyped-def]
    """Current of each pixel in the steady state under `mean` (n,), electrons/s."""
    current = np.empty_like(mean)
    for p in range(mean.size):
        word = word_at(np.uint64(number[p]), np.uint64(0), _INITIAL, seed, _STREAM)
        current[p] = mean[p] + math.sqrt(mean[p] / (2 * tau)) * normal(word, table)
    return current


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def walk(  # type: ignore[no-untyped-def]
    chunk0, chunk1, current, reference, when, measuring, charge, response, variance, mean, number,
    first, slope, gain, dark, begin, h, tick0, finish, tau, period, contrast, floor, measure, dead,
    seed, table, counts, pixels, ticks, values,
):  # fmt: skip
    """Carries monitors through `begin.size` steps of h seconds in one piece of light.

    Args:
        begin: seconds from the piece's start to each step's.
        finish: each step ends a tick, tick0 and those after it; else the one step is a part of
            tick0 that another goes on from.
        response, variance, mean: c, v and g of the tick's parts so far, (n,), or (0,) where every
            step is a whole tick.
        first: light at the piece's start, slope: its change a second (n,).
        measure, dead: ticks. Others as in `jump`.
    """
    a = math.exp(-h / tau)
    a2 = a * a
    room, parts = pixels.shape[1], response.size > 0
    for chunk in range(chunk0, chunk1):
        n = 0
        for p in range(chunk * CHUNK, min((chunk + 1) * CHUNK, current.size)):
            f, k = gain[p] * first[p] + dark[p], gain[p] * slope[p]
            y, r, pixel = current[p], reference[p], np.uint64(number[p])
            threshold = max(contrast * r, floor) if r == r else floor
            c, v = f * (1 - a), f * (1 - a2) / (2 * tau)
            deviation = math.sqrt(v)
            w0 = w1 = w2 = w3 = np.uint64(0)
            block = np.int64(-1)
            for j in range(begin.size):
                g = 0.0
                if k != 0:
                    i0 = max(f + k * begin[j], 0.0)
                    i1 = max(f + k * (begin[j] + h), 0.0)
                    c = i1 - k * tau - a * (i0 - k * tau)
                    v = max((i1 - a2 * i0 - 0.5 * k * tau * (1 - a2)) / (2 * tau), 0.0)
                    g = 0.5 * (i0 + i1) * h
                else:
                    g = f * h
                if parts:
                    c += a * response[p]
                    v += a2 * variance[p]
                    g += mean[p]
                    if not finish:
                        # y itself stays as it was when the tick began
                        response[p], variance[p], mean[p] = c, v, g
                        continue
                if k != 0 or parts:
                    deviation = math.sqrt(v)
                tick = tick0 + j
                if tick >> 2 != block:
                    block = tick >> 2
                    w0, w1, w2, w3 = random_words(pixel, np.uint64(block), _FILTER, seed, _STREAM)
                noise = deviation * normal(pick(tick, w0, w1, w2, w3), table)
                y = (math.exp(-period / tau) if parts else a) * y + c + noise
                if measuring[p]:
                    if v > 0:
                        rest = math.sqrt(max(g - c * c / v, 0.0))
                        word = word_at(pixel, np.uint64(tick), _MEASURED, seed, _STREAM)
                        charge[p] += g + c / v * noise + rest * normal(word, table)
                    if tick < when[p]:
                        continue
                    value = charge[p] / (measure * period)
                elif tick < when[p] or abs(y - r) < threshold:
                    continue
                elif measure > 0:
                    measuring[p], when[p], charge[p] = 1, tick + measure, 0.0
                    continue
                else:
                    value = y
                if n < room:
                    pixels[chunk, n], ticks[chunk, n], values[chunk, n] = p, tick, value
                n += 1
                r = max(value, 0.0)
                threshold = max(contrast * r, floor)
                measuring[p], charge[p], when[p] = 0, 0.0, tick + 1 + dead
            current[p], reference[p] = y, r
        counts[chunk] = n


@cache
def quantile_table() -> npt.NDArray[np.float64]:
    """Quantiles at the cells' ends, (cells + 1,); the first and last are infinite."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.arange(_CELLS + 1) / _CELLS), np.float64)


@njit(cache=True, nogil=True)
def normal(word, table):  # type: ignore[no-untyped-def]
    """The same, from the table where it is good enough."""
    cell = np.int64(word >> _SHIFT)
    if cell < _TAIL or cell >= _CELLS - _TAIL:
        return quantile(word)
    low = table[cell]
    part = (np.float64(np.int64(word & _INSIDE)) + 0.5) * 2.0**-_CELL_BITS
    return low + (table[cell + 1] - low) * part


# fmt: off
@njit(cache=True, nogil=True)
def quantile(word):  # type: ignore[no-untyped-def]
    """The standard normal quantile at (word + 1/2) / 2^32."""
    u = (np.float64(word) + 0.5) * 2.0**-32
    q = u - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        top = (((((((2.5090809287301226727e3 * r + 3.3430575583588128105e4) * r
            + 6.7265770927008700853e4) * r + 4.5921953931549871457e4) * r
            + 1.3731693765509461125e4) * r + 1.9715909503065514427e3) * r
            + 1.3314166789178437745e2) * r + 3.3871328727963666080e0)
        low = (((((((5.2264952788528545610e3 * r + 2.8729085735721942674e4) * r
            + 3.9307895800092710610e4) * r + 2.1213794301586595867e4) * r
            + 5.3941960214247511077e3) * r + 6.8718700749205790830e2) * r
            + 4.2313330701600911252e1) * r + 1.0)
        return q * top / low
    z = math.sqrt(-math.log(u if q < 0 else 1.0 - u)) - 1.6
    upper = (((((((7.74545014278341407640e-4 * z + 2.27238449892691845833e-2) * z
        + 2.41780725177450611770e-1) * z + 1.27045825245236838258e0) * z
        + 3.64784832476320460504e0) * z + 5.76949722146069140550e0) * z
        + 4.63033784615654529590e0) * z + 1.42343711074968357734e0)
    lower = (((((((1.05075007164441684324e-9 * z + 5.47593808499534494600e-4) * z
        + 1.51986665636164571966e-2) * z + 1.48103976427480074590e-1) * z
        + 6.89767334985100004550e-1) * z + 1.67638483018380384940e0) * z
        + 2.05319162663775882187e0) * z + 1.0)
    return -upper / lower if q < 0 else upper / lower
# fmt: on
