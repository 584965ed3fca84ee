"""Stability cases 28 to 32, of a link.

They cover a link without background, weak and strong turbulence, error rates below rounding,
metrics that underflow, and a payload of one repeated byte.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from decimal import Decimal, localcontext
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.case import Case
from link.line_codes import decode_line, encode_line
from link.theory import gamma_gamma_ook, poisson_capacity, rs_word_error

Floats = npt.NDArray[np.float64]


def _worst(pairs: Sequence[tuple[float, float]]) -> float:
    """Largest relative error of (value, truth); infinite if a value is not a number."""
    errors = [abs(value / truth - 1) if truth else abs(value) for value, truth in pairs]
    return max(error if math.isfinite(error) else math.inf for error in errors)


# 28 ------------------------------------------------------------------------------------------

Capacity = Callable[[float], float]
"""Ratio of background to peak -> bits per peak photon."""


def _capacity(device: Device | None) -> Capacity:
    return lambda dark: float(poisson_capacity(dark))


def background(capacity: Capacity) -> float:
    """Largest relative error of the Poisson capacity, for backgrounds from 0 to 1e18."""
    pairs = []
    with localcontext() as context:
        context.prec = 80
        for text in ("0", "1e-300", "1e-15", "0.1", "1", "30", "1e3", "3e4", "2e5", "1e9", "1e18"):
            s = Decimal(text)
            s_ln = s * s.ln() if s else Decimal(0)
            duty = ((1 + s) * (1 + s).ln() - s_ln - 1).exp() - s
            mixed = (duty + s) * (duty + s).ln()
            nats = duty * (1 + s) * (1 + s).ln() + (1 - duty) * s_ln - mixed
            pairs.append((capacity(float(text)), float(nats / Decimal(2).ln())))
    return _worst(pairs)


# 29 ------------------------------------------------------------------------------------------

Fading = Callable[[float, float, float], float]
"""(amplitude, alpha, beta) -> error rate of on-off keying."""


def _fading(device: Device | None) -> Fading:
    return lambda amplitude, alpha, beta: float(gamma_gamma_ook(amplitude, alpha, beta))


def fading(rate: Fading) -> float:
    """Largest relative error of a gamma-gamma error rate.

    Shapes are so large that there is practically no fading, and signals so strong that one term of
    the series is left.
    """
    pairs = []
    for shape in (200.0, 1e4, 1e9, 1e15):
        for a in (0.3, 4.0, 12.0):
            # Inverse gamma functions fail near 1e10; no fading has a relative error of a^4 / shape.
            truth = _plain(a) if shape > 1e10 else _two_fold(a, shape)
            pairs.append((rate(a, shape, shape), truth))
    for alpha, beta in ((4.0, 1.9), (5.69, 1.1), (160.0, 2.5)):
        for a in (1e12, 1e14):
            pairs.append((rate(a, alpha, beta), _deep(a, alpha, beta)))
    return _worst(pairs)


def _plain(a: float) -> float:
    return math.erfc(a / 2 / math.sqrt(2)) / 2


def _two_fold(a: float, shape: float) -> float:
    """Mean over the quantiles of both variates.

    Gauss-Legendre quadrature on intervals that shrink towards both ends.
    """
    from scipy.special import erfc, gammainccinv, gammaincinv

    ends = np.concatenate([[0.0], 10.0 ** np.arange(-24, 0, 0.5), [0.4, 0.5]])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    middle, half = (ends[1:] + ends[:-1]) / 2, (ends[1:] - ends[:-1]) / 2
    u = (middle[:, None] + half[:, None] * nodes).ravel()
    w = np.tile((half[:, None] * weights).ravel(), 2)
    x = np.concatenate([gammaincinv(shape, u), gammainccinv(shape, u)]) / shape
    values = erfc(a * x[:, None] * x / 2 / math.sqrt(2)) / 2
    return float(w @ values @ w)


def _deep(a: float, alpha: float, beta: float) -> float:
    """Error rate of a strong signal.

    The density near 0 is (alpha beta)^beta Gamma(alpha - beta) / (Gamma(alpha) Gamma(beta)) I^(beta
    - 1), and the integral of Q(t) t^(beta - 1) is 2^(beta/2) Gamma((beta + 1) / 2) / (2 beta
    sqrt(pi)).
    """
    logs = beta * math.log(alpha * beta) + math.lgamma(alpha - beta)
    logs -= math.lgamma(alpha) + math.lgamma(beta)
    logs += beta * math.log(2 / a) + beta / 2 * math.log(2) + math.lgamma((beta + 1) / 2)
    return math.exp(logs - math.log(2 * beta) - math.log(math.pi) / 2)


# 30 ------------------------------------------------------------------------------------------

Tails = Callable[[int, int, float], float]
"""(symbols of a word, correctable ones, their error rate) -> word error rate."""


def _tails(device: Device | None) -> Tails:
    return lambda n, t, p: float(rs_word_error(n, n - 2 * t, p))


def tails(rate: Tails) -> float:
    """Largest relative error of word error rates down to 1e-300."""
    pairs = []
    cases = ((255, 16, 1e-2), (255, 16, 1e-9), (255, 8, 1e-33), (31, 1, 1e-150), (255, 64, 0.2))
    with localcontext() as context:
        context.prec = 50
        for n, t, p in cases:
            exact, terms = Decimal(p), range(t + 1, n + 1)
            total = sum(math.comb(n, j) * exact**j * (1 - exact) ** (n - j) for j in terms)
            pairs.append((rate(n, t, p), float(total)))
    return _worst(pairs)


# 31 ------------------------------------------------------------------------------------------

Decode = Callable[[Any, npt.NDArray[np.float32]], npt.NDArray[np.uint8]]
"""(line code, soft values (symbols, cells)) -> values (groups, cells)."""
SCALES: Final = (2.0**-6, 1.0, 2.0**3)
"""Factors on soft values of 400 to 900 nats; the decoder clips at 1e4."""


def _decode(device: Device | None) -> Decode:
    return lambda line, soft: decode_line(line, soft)[0]


def metrics(decode: Decode, cells: int = 200) -> float:
    """Number of wrong values of line codes read from soft values of any size.

    Some soft values have the wrong sign. The truth is the largest integer sum over all words; words
    with equal sums are left out.
    """
    wrong, rng = 0, np.random.Generator(np.random.Philox(key=31))
    for line, count in (("manchester", 2), ("4b6b", 16), ("8b10b", 256)):
        every = np.arange(count, dtype=np.uint8)[None]
        book = [
            encode_line(line, every, disparity=np.full(count, start))
            for start in ((False, True) if line == "8b10b" else (False,))
        ]
        words = np.stack([b.T.astype(np.int64) * 2 - 1 for b in book])  # (starts, values, symbols)
        sent = rng.integers(0, count, cells)
        # Powers of two make most sums differ.
        symbols = words.shape[2]
        weight = 400 + (1 << rng.permuted(np.tile(np.arange(symbols), (cells, 1)), axis=1))
        flip = rng.random((cells, symbols)) < 0.08
        soft = words[0, sent] * np.where(flip, -1, 1) * weight
        sums = np.einsum("svk,ck->csv", words, soft).max(1)
        best = sums.argmax(1)
        clear = (sums == sums.max(1, keepdims=True)).sum(1) == 1
        for scale in SCALES:
            read = decode(line, (soft.T * scale).astype(np.float32))[0]
            wrong += int((read != best)[clear].sum())
    return float(wrong)


# 32 ------------------------------------------------------------------------------------------

Encode = Callable[[Any, npt.NDArray[np.uint8]], npt.NDArray[np.bool_]]
"""(line code, values (groups, cells)) -> (symbols, cells)."""


def _encode(device: Device | None) -> Encode:
    return lambda line, values: encode_line(line, values)


def _longest(bits: npt.NDArray[np.bool_]) -> int:
    """Longest run of equal symbols of any cell."""
    longest, run = 1, np.ones(bits.shape[1], np.int64)
    for before, now in pairwise(bits):
        run = np.where(before == now, run + 1, 1)
        longest = max(longest, int(run.max()))
    return longest


def payloads(encode: Encode, groups: int = 400) -> float:
    """Largest excess of a run over the code's limit, or of the ON share over 1/2.

    Payloads are one repeated value (each value in one cell), and all values in turn.
    """
    worst = 0.0
    for line, count, limit in (("manchester", 2, 2), ("4b6b", 16, 4), ("8b10b", 256, 5)):
        every = np.arange(count, dtype=np.uint8)
        constant = np.tile(every, (groups, 1))
        turning = (constant + np.arange(groups)[:, None]) % count
        for values in (constant, turning.astype(np.uint8)):
            bits = encode(line, values)
            leaning = float(np.abs(bits.mean(0) - 0.5).max())
            worst = max(worst, _longest(bits) - limit, leaning - 2 / len(bits))
    return worst


LINKING: Final = (
    Case(
        28,
        "no background",
        "Poisson capacity for backgrounds from none to 1e18 of the peak",
        "80 digits",
        "the formula as printed",
        "relative error",
        1e-10,
        background,
        _capacity,
    ),
    Case(
        29,
        "gamma-gamma at its limits",
        "error rates with shapes to 1e15 and signals to 1e14",
        "quantiles, no fading, leading term",
        "quadrature of the density",
        "relative error",
        1e-8,
        fading,
        _fading,
    ),
    Case(
        30,
        "error rates below rounding",
        "word error rates down to 1e-300",
        "50 digits",
        "1 - cdf",
        "relative error",
        1e-10,
        tails,
        _tails,
    ),
    Case(
        31,
        "metrics that underflow",
        "line codes read from soft values of 6 to 7000 nats are the likeliest words",
        "integers",
        "products of probabilities",
        "wrong values",
        0.0,
        metrics,
        _decode,
    ),
    Case(
        32,
        "a payload of one value",
        "runs within the code's limit, and as many ON as OFF, for every value for ever",
        "counts",
        "bytes as they are; 8B10B of one disparity",
        "symbols",
        0.0,
        payloads,
        _encode,
        {"groups": 60},
    ),
)
