"""The range coder: near the entropy of its decisions, exact, and safe with any bytes."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from sensor.codec.packets.ranges import (
    FRESH,
    decode_bit,
    encode_bits,
    from_bytes,
    open_bits,
    to_bytes,
)


@njit
def decode(words, model, contexts, out):
    code, span, at = open_bits(words)
    data, states = np.int64(words.ctypes.data), np.int64(model.ctypes.data)
    for i in range(contexts.size):
        bit, code, span, at = decode_bit(
            data, words.size, states, np.int64(contexts[i]), code, span, at
        )
        out[i] = bit


def encoded(contexts, bits) -> bytes:
    decisions = (contexts * 2 + bits).astype(np.uint16)
    out = np.empty(len(bits) // 2 + 4, np.uint32)
    model = np.full(contexts.max(initial=0) + 1, FRESH)
    return to_bytes(out[: encode_bits(decisions, len(bits), model, out)])


def decoded(data, contexts):
    bits = np.empty(len(contexts), np.uint8)
    decode(from_bytes(data), np.full(contexts.max(initial=0) + 1, FRESH), contexts, bits)
    return bits


@pytest.mark.parametrize("p", [0.0, 1e-3, 0.1, 0.5, 0.9, 0.999, 1.0])
def test_decisions_come_back_and_take_their_entropy(p):
    rng = np.random.default_rng(1)
    n = 40_000
    contexts = rng.integers(0, 8, n)
    bits = (rng.random(n) < p).astype(int)
    data = encoded(contexts, bits)
    assert (decoded(data, contexts) == bits).all()
    entropy = sum(-q * np.log2(q) * n for q in (p, 1 - p) if q > 0)
    # Learning: log2(n) / 2 bits a context, 1 / (2 LIMIT ln 2) bits a decision, and the last word.
    assert 8 * len(data) <= entropy * 1.004 + n / (2 * 250 * np.log(2)) * (0 < p < 1) + 200
    assert 8 * len(data) > entropy - 4 * np.sqrt(n)


def test_zeros_take_no_bytes():
    assert encoded(np.zeros(1000, int), np.zeros(1000, int)) == b""


@pytest.mark.parametrize("seed", range(60))
def test_carries_reach_back(seed):
    """Certain ones keep the interval's upper end: a carry runs through words of all ones."""
    rng = np.random.default_rng(seed)
    contexts = np.zeros(3000, int)
    bits = np.ones(3000, int)
    bits[rng.integers(0, 3000, rng.integers(1, 4))] = 0
    assert (decoded(encoded(contexts, bits), contexts) == bits).all()


def test_any_bytes_decode_to_something():
    rng = np.random.default_rng(3)
    for size in range(0, 40, 3):
        assert len(decoded(rng.bytes(size), rng.integers(0, 3, 500))) == 500
