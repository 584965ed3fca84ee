"""An adaptive binary range coder, compiled.

A decision is one bit in a context. Its probability is learned while it is coded: the
first decisions move it by 1/(n + 1.5), later ones by 1/`LIMIT`, so that encoder and decoder agree
without tables, and a packet that starts anew has learned within a few dozen decisions.

The interval has 64 bits and gives up 32 at once when it is shorter than 2^32: one rare and well
predicted branch. A carry goes back into words that are already written. All arithmetic is of whole
numbers, so that every machine writes the same bits. A run of zeros at the end takes no bytes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.codec.packets.memory import peek32, poke32

Model = npt.NDArray[np.uint32]
"""State of each context: probability of a zero, 22 bits, then the decisions seen, 10 bits."""
FRESH = np.uint32(1 << 31)
"""State of a context that has seen nothing: one half."""
LIMIT = 250
_CERTAIN = (1 << 22) - 1
_RATE = (65536 / (np.arange(1024).clip(0, LIMIT) + 1.5)).astype(np.int64)
_ONE = np.uint64(1)
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_SHARE = np.uint64(16)


@njit(cache=True, nogil=True, inline="always")
def _learned(state, bit):  # type: ignore[no-untyped-def]
    """The state of a context after a decision; all int64."""
    seen = state & 1023
    p = state >> 10
    p += (((1 - bit) * _CERTAIN - p) * _RATE[seen]) >> 16
    return (p << 10) | (seen + (1 if seen < LIMIT else 0))


@njit(cache=True, nogil=True)
def encode_bits(decisions, count, model, out):  # type: ignore[no-untyped-def]
    """Codes decisions 0 to `count`; the number of words written to `out`.

    decisions: (n,) uint16, twice the context plus the bit. model: (contexts,) uint32, changed.
    out: uint32, with room for `count` / 2 + 4 words: a decision takes at most 16 bits.
    """
    low, span, at = np.uint64(0), np.uint64(0xFFFFFFFFFFFFFFFF), 0
    for i in range(count):
        decision = np.int64(decisions[i])
        context, bit = decision >> 1, decision & 1
        state = np.int64(model[context])
        bound = (span >> _SHARE) * (np.uint64(state >> 16) | _ONE)
        step = bound if bit else np.uint64(0)
        span = span - bound if bit else bound
        low += step
        if low < step:
            _carry(out, at)
        model[context] = _learned(state, bit)
        if span <= _LOW:
            out[at] = low >> _HALF
            at += 1
            low <<= _HALF
            span <<= _HALF
    for bits in (56, 48, 40, 32):  # the shortest number in [low, low + span); zeros follow it
        mask = (_ONE << np.uint64(bits)) - _ONE
        end = (low + mask) & ~mask
        if end - low < span:
            break
    if end < low:
        _carry(out, at)
    out[at] = end >> _HALF
    return at + 1


@njit(cache=True, nogil=True)
def _carry(out, at):  # type: ignore[no-untyped-def]
    """Adds one to the number that the words before `at` are."""
    at -= 1
    while at >= 0 and out[at] == np.uint32(0xFFFFFFFF):
        out[at] = 0
        at -= 1
    if at >= 0:
        out[at] += np.uint32(1)


@njit(cache=True, nogil=True)
def open_bits(words):  # type: ignore[no-untyped-def]
    """(code, span, place) of a decoder at the beginning of `from_bytes`."""
    code = (np.uint64(words[0]) << _HALF) | np.uint64(words[1])
    return code, np.uint64(0xFFFFFFFFFFFFFFFF), 2


@njit(cache=True, nogil=True, inline="always")
def decode_bit(words, size, model, context, code, span, at):  # type: ignore[no-untyped-def]
    """(bit, code, span, place) of the next decision in a context. Beyond the words are zeros.

    words, model: addresses of uint32; size: number of words.
    """
    state = peek32(model, context)
    bound = (span >> _SHARE) * (np.uint64(state >> 16) | _ONE)
    if code < bound:
        bit = 0
        span = bound
    else:
        bit = 1
        code -= bound
        span -= bound
    poke32(model, context, _learned(state, bit))
    if span <= _LOW:
        code <<= _HALF
        if at < size:
            code |= np.uint64(peek32(words, at))
        span <<= _HALF
        at += 1
    return bit, code, span, at


def to_bytes(words: npt.NDArray[Any]) -> bytes:
    """Bytes of the words of an encoder, without the zeros at their end."""
    return words.astype(">u4").tobytes().rstrip(b"\0")


def from_bytes(data: bytes) -> npt.NDArray[np.uint32]:
    """Words of `to_bytes`, at least two."""
    padded = data + bytes(max(8 - len(data), -len(data) % 4))
    return np.frombuffer(padded, ">u4").astype(np.uint32)
