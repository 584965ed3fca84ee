"""Naive methods, one at least for each of cases 28 to 32 of the stability suite."""

from __future__ import annotations

import numpy as np
from scipy.special import erfc, gamma, kv
from scipy.stats import binom

from link.line_codes import CATALOGUE, encode_line


def printed_capacity(dark: float) -> float:
    """Case 28: the formula as it is printed."""
    s = np.float64(dark)
    with np.errstate(all="ignore"):
        q = (1 + s) ** (1 + s) / (s**s * np.e) - s
        nats = q * (1 + s) * np.log(1 + s) + (1 - q) * s * np.log(s) - (q + s) * np.log(q + s)
    return float(nats / np.log(2))


def density_quadrature(amplitude: float, alpha: float, beta: float) -> float:
    """Case 29: the density of the intensity by gamma functions and a Bessel function, summed over
    intensities to 20."""
    i = np.linspace(1e-6, 20, 200_001)
    with np.errstate(all="ignore"):
        density = 2 * np.float64(alpha * beta) ** ((alpha + beta) / 2)
        density /= gamma(alpha) * gamma(beta)
        density = density * i ** ((alpha + beta) / 2 - 1)
        density = density * kv(alpha - beta, 2 * np.sqrt(alpha * beta * i))
        values = density * erfc(amplitude * i / 2 / np.sqrt(2)) / 2
    return float(values.sum() * (i[1] - i[0]))


def one_less_cdf(n: int, t: int, p: float) -> float:
    """Case 30: what is not mended is all but what is."""
    return float(1 - binom.cdf(t, n, p))


def products(line, soft):  # type: ignore[no-untyped-def]
    """Case 31: the word of the largest product of its symbols' probabilities."""
    count = {"manchester": 2, "4b6b": 16, "8b10b": 256}[line]
    every = np.arange(count, dtype=np.uint8)[None]
    with np.errstate(all="ignore"):
        on = 1 / (1 + np.exp(-soft.astype(np.float64)))
    off = 1 - on
    symbols = CATALOGUE[line].symbols
    best = np.zeros((count, soft.shape[1]))
    for start in (False, True) if line == "8b10b" else (False,):
        word = encode_line(line, every, disparity=np.full(count, start))
        chance = np.ones_like(best)
        for k in range(symbols):
            chance = chance * np.where(word[k][:, None], on[k], off[k])
        best = np.maximum(best, chance)
    return best.argmax(0)[None].astype(np.uint8)


def bytes_as_they_are(line, values):  # type: ignore[no-untyped-def]
    """Case 32: no line code: as many of a value's bits as the code has symbols."""
    symbols = CATALOGUE[line].symbols
    bits = [(values.astype(np.uint16) >> k) & 1 for k in range(symbols)]
    return np.stack(bits, axis=1).reshape(-1, values.shape[1]).astype(bool)


def one_disparity(line, values):  # type: ignore[no-untyped-def]
    """Case 32: every group of 8B10B begins as if the disparity were negative."""
    return np.concatenate([encode_line(line, group[None]) for group in values])
