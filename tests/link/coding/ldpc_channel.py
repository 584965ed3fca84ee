"""Bits as +-1 in white noise, what that channel can carry, and a decoder of another kind."""

from itertools import pairwise

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp

from link.coding.ldpc import quantise

_NODE, _WEIGHT = np.polynomial.hermite.hermgauss(100)


def capacity(sigma):
    """Bits that a sign in noise of standard deviation sigma carries."""
    soft = 2 / sigma**2 + 2 / sigma * np.sqrt(2) * _NODE
    lost = logsumexp([np.zeros_like(soft), -soft], axis=0) / np.log(2)
    return 1 - (_WEIGHT @ lost) / np.sqrt(np.pi)


def noise_at(share, rate):
    """Standard deviation of the noise in which `rate` is a share of the capacity."""
    return brentq(lambda sigma: capacity(sigma) - rate / share, 0.2, 3)


def noise_of(decibel, rate):
    """Standard deviation of the noise for Eb/N0 in dB."""
    return np.sqrt(1 / (2 * rate * 10 ** (decibel / 10)))


def sent(code, count, sigma, seed):
    """Random data, (count, bytes), and soft values in natural units, (count, word_bits)."""
    rng = np.random.default_rng(seed)
    data = rng.integers(0, 256, (count, code.data_bits // 8), dtype=np.uint8)
    bits = np.unpackbits(code.encode(data), axis=1, bitorder="little")
    seen = bits * np.float32(2) - 1
    seen += np.float32(sigma) * rng.standard_normal(seen.shape, np.float32)
    return data, seen * np.float32(2 / sigma**2)


def failures(code, count, sigma, seed, rounds, device=None):
    """Numbers of wrong words, and of wrong ones that were called right."""
    wrong = silent = 0
    for start in range(0, count, 2000):  # their soft values fill much memory
        data, soft = sent(code, min(2000, count - start), sigma, seed + start)
        read, ok, _ = code.decode(quantise(soft), rounds, device)
        here = (read != data).any(axis=1)
        wrong += int(here.sum())
        silent += int((here & ok).sum())
    return wrong, silent


def decode_by_sums_and_products(code, soft, rounds):
    """Data of words by layered belief propagation in float32, without approximation."""

    def phi(x):
        return -np.log(np.tanh(np.clip(x, 1e-6, 30) / 2))

    starts, columns, shifts = code.schedule
    places = (np.arange(code.lifting) + shifts[:, None]) % code.lifting
    rows = [(slice(a, b), columns[a:b, None], places[a:b]) for a, b in pairwise(starts)]
    end = code.data_columns * code.lifting
    bits = np.zeros((len(soft), code.columns * code.lifting), np.float32)
    bits[:, code.data_bits - code.sent_data : code.data_bits] = -soft[:, : code.sent_data]
    bits[:, code.data_bits : end] = 100
    bits[:, end : end + code.word_bits - code.sent_data] = -soft[:, code.sent_data :]
    bits = bits.reshape(len(soft), code.columns, code.lifting)
    messages = np.zeros((len(soft), len(columns), code.lifting), np.float32)
    for _ in range(rounds):
        for edges, column, place in rows:
            value = bits[:, column, place] - messages[:, edges]
            size, minus = phi(np.abs(value)), value < 0
            size = phi(size.sum(axis=1, keepdims=True) - size)
            minus ^= np.logical_xor.reduce(minus, axis=1, keepdims=True)
            messages[:, edges] = np.where(minus, -size, size)
            bits[:, column, place] = value + messages[:, edges]
    hard = bits.reshape(len(soft), -1)[:, : code.data_bits] < 0
    return np.packbits(hard, axis=1, bitorder="little")
