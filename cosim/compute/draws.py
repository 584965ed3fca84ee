"""Random numbers of any law by a counter: Poisson, normal, gamma, binomial.

Every draw has the key (seed, stream) and the counter (pixel, frame). It depends neither on how a
frame is divided nor on earlier draws. Rejection methods count attempts in the fourth word of the
counter. If the mean differs slightly between two runs (an effect is left out), the draws differ
slightly: the methods were chosen so that paired runs stay correlated.

Poisson: inversion below a mean of 12, else transformed rejection PTRS (Hoermann, Insurance:
Mathematics and Economics 12:39, 1993). Gamma: Marsaglia and Tsang, ACM TOMS 26:363 (2000), with
their boost below shape 1. Negative binomial: a Poisson whose mean is gamma distributed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from cosim.compute.philox_compiled import random_words
from cosim.compute.streams import Stream

Values = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Numbers = npt.NDArray[np.int64]
"""Number of each pixel in its imager, of the values' shape."""
_TWO_PI = 2 * math.pi
_SMALL = 12.0
_SECOND = 1 << 20
"""First draw of the second law of a compound one."""
_PART = 1 << 17
"""Draws that are worth a thread of their own: some milliseconds."""


@njit(cache=True, nogil=True)
def uniforms(pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    """Two uniform numbers within (0, 1), of 53 bits."""
    a, b, c, d = random_words(
        np.uint64(pixel), np.uint64(frame), np.uint64(draw), np.uint64(seed), np.uint64(stream)
    )
    u = (float(a >> np.uint64(5)) * 67108864.0 + float(b >> np.uint64(6)) + 0.5) / 2.0**53
    v = (float(c >> np.uint64(5)) * 67108864.0 + float(d >> np.uint64(6)) + 0.5) / 2.0**53
    return u, v


@njit(cache=True, nogil=True)
def _normal_one(pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    u, v = uniforms(pixel, frame, draw, seed, stream)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(_TWO_PI * v)


@njit(cache=True, nogil=True)
def _poisson_one(mean, pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    """draw: first attempt; a later one takes the next number."""
    if mean <= 0.0:
        return 0
    if mean < _SMALL:
        u, _ = uniforms(pixel, frame, draw, seed, stream)
        k, term = 0, math.exp(-mean)
        total = term
        while u > total and k < 200:
            k += 1
            term *= mean / k
            total += term
        return k
    root, log_mean = math.sqrt(mean), math.log(mean)
    b = 0.931 + 2.53 * root
    a = -0.059 + 0.02483 * b
    inverse = math.log(1.1239 + 1.1328 / (b - 3.4))
    bound = 0.9277 - 3.6224 / (b - 2.0)
    while True:
        u, v = uniforms(pixel, frame, draw, seed, stream)
        draw += 1
        u -= 0.5
        edge = 0.5 - abs(u)
        k = math.floor((2.0 * a / edge + b) * u + mean + 0.43)
        if edge >= 0.07 and v <= bound:
            return int(k)
        if k < 0 or (edge < 0.013 and v > edge):
            continue
        log_v = math.log(v) + inverse - math.log(a / (edge * edge) + b)
        if log_v <= k * log_mean - mean - math.lgamma(k + 1.0):
            return int(k)


@njit(cache=True, nogil=True)
def _gamma_one(shape, pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    """One Gamma number of unit scale. Two counters an attempt: a normal and a uniform number."""
    if shape <= 0.0:
        return 0.0
    boost = 1.0
    if shape < 1.0:
        u, _ = uniforms(pixel, frame, draw, seed, stream)
        boost = u ** (1.0 / shape)
        shape += 1.0
        draw += 1
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x = _normal_one(pixel, frame, draw, seed, stream)
        u, _ = uniforms(pixel, frame, draw + 1, seed, stream)
        draw += 2
        v = 1.0 + c * x
        if v <= 0.0:
            continue
        v = v * v * v
        if math.log(u) < 0.5 * x * x + d - d * v + d * math.log(v):
            return d * v * boost


@njit(cache=True, nogil=True)
def _poisson(mean, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    for n in range(mean.size):
        out[n] = _poisson_one(mean[n], numbers[n], frame, 0, seed, stream)


@njit(cache=True, nogil=True)
def _normal(numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    for n in range(numbers.size):
        out[n] = _normal_one(numbers[n], frame, 0, seed, stream)


@njit(cache=True, nogil=True)
def _gamma(shape, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    for n in range(shape.size):
        out[n] = _gamma_one(shape[n], numbers[n], frame, 0, seed, stream)


@njit(cache=True, nogil=True)
def _negative_binomial(count, mean, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    for n in range(count.size):
        rate = _gamma_one(float(count[n]), numbers[n], frame, 0, seed, stream) * mean[n]
        out[n] = _poisson_one(rate, numbers[n], frame, _SECOND, seed, stream)


@njit(cache=True, nogil=True)
def _binomial(count, share, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    for n in range(count.size):
        total, p = count[n], share[n]
        if p <= 0.0 or total <= 0:
            out[n] = 0
            continue
        if p >= 1.0:
            out[n] = total
            continue
        # First the count of a beta: the median order statistic halves what is left (Relles, JASA
        # 67:612, 1972), until few enough are left to be drawn one by one.
        found, draw = 0, 0
        while total > 16:
            half = total // 2 + 1
            x = _gamma_one(float(half), numbers[n], frame, draw, seed, stream)
            y = _gamma_one(float(total + 1 - half), numbers[n], frame, draw + 256, seed, stream)
            draw += 512
            order = x / (x + y)
            if order <= p:
                found += half
                total -= half
                p = (p - order) / (1.0 - order)
            else:
                total = half - 1
                p = p / order
        for each in range(total):
            u, _ = uniforms(numbers[n], frame, draw + each, seed, stream)
            found += u < p
        out[n] = found


def _draw(law: Callable[..., None], given: tuple[Any, ...], numbers: Numbers, frame: int, seed: int,
          stream: Stream, out: Any) -> None:  # fmt: skip
    """Draws from a compiled distribution, large planes on all cores. The result does not depend on
    threads, since each pixel has its own counter. given: flat arrays of the parameters."""
    flat = _pixels(numbers)

    def part(first: int, stop: int, out: Any) -> None:
        at = slice(first, stop)
        law(*(each[at] for each in given), flat[at], frame, seed, int(stream), out[at])

    by_rows(part, out.size, out, least=2 * _PART - 1)


def _flat(values: npt.ArrayLike, numbers: Numbers) -> Values:
    shaped = np.broadcast_to(np.asarray(values, np.float64), numbers.shape)
    # Writable as well: a law would be compiled once more for arrays that are not.
    return np.require(shaped, np.float64, ["C", "W"]).reshape(-1)


def _pixels(numbers: Numbers) -> Numbers:
    return np.require(numbers, np.int64, ["C", "W"]).reshape(-1)


def poisson(mean: npt.ArrayLike, numbers: Numbers, frame: int, seed: int, stream: Stream) -> Counts:
    """Poisson counts of these means (below about 1e15), of the shape of `numbers`."""
    out = np.empty(numbers.size, np.int64)
    _draw(_poisson, (_flat(mean, numbers),), numbers, frame, seed, stream, out)
    return out.reshape(numbers.shape)


def normal(numbers: Numbers, frame: int, seed: int, stream: Stream) -> Values:
    """Normal numbers of mean 0 and variance 1."""
    out = np.empty(numbers.size)
    _draw(_normal, (), numbers, frame, seed, stream, out)
    return out.reshape(numbers.shape)


def gamma(shape: npt.ArrayLike, numbers: Numbers, frame: int, seed: int, stream: Stream) -> Values:
    """Gamma distributed numbers of unit scale; 0 where the shape is 0."""
    out = np.empty(numbers.size)
    _draw(_gamma, (_flat(shape, numbers),), numbers, frame, seed, stream, out)
    return out.reshape(numbers.shape)


def negative_binomial(
    count: npt.ArrayLike, mean: npt.ArrayLike, numbers: Numbers, frame: int, seed: int,
    stream: Stream,
) -> Counts:  # fmt: skip
    """Sum of `count` geometric counts (from 0) of this mean each: mean count x mean, variance
    count x mean x (1 + mean)."""
    out = np.empty(numbers.size, np.int64)
    given = _flat(count, numbers), _flat(mean, numbers)
    _draw(_negative_binomial, given, numbers, frame, seed, stream, out)
    return out.reshape(numbers.shape)


def binomial(
    count: npt.ArrayLike, share: npt.ArrayLike, numbers: Numbers, frame: int, seed: int,
    stream: Stream,
) -> Counts:  # fmt: skip
    """How many of `count` are kept, each with probability `share`."""
    out = np.empty(numbers.size, np.int64)
    counts = _flat(count, numbers).astype(np.int64)
    _draw(_binomial, (counts, _flat(share, numbers)), numbers, frame, seed, stream, out)
    return out.reshape(numbers.shape)
