"""An adaptive binary range coder, compiled, for decisions and for whole numbers.

A decision is one bit in a context. Its probability is learned while it is coded: the
first decisions move it by 1/(n + 1.5), later ones by 1/`LIMIT`, so that encoder and decoder agree
without tables, and a packet that starts anew has learned within a few dozen decisions.

The interval has 64 bits and gives up 32 at once when it is shorter than 2^32: one rare and well
predicted branch. A carry goes back into words that are already written. All arithmetic is of whole
numbers, so that every machine writes the same bits. A run of zeros at the end takes no bytes.

A number is coded beside its expectation: whether it is equal, on which side it lies, and how far
away, in Elias's gamma code, the exponent in unary. Each of these decisions has a context of its
own, so that the shape of the law is learned, whatever it is, also where the expectation lies
between two whole numbers.

numba counts references to an array wherever inlined code takes a branch, which costs more than a
decision of the range coder. So the inner loops take the addresses of arrays, whose life and size
their caller guarantees, and read and write numbers there in single instructions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit
from numba.core import cgutils, types
from numba.extending import intrinsic

Model = npt.NDArray[np.uint32]
FRESH = np.uint32(1 << 31)
"""State of a context that has seen nothing: one half."""
LIMIT = 250
_CERTAIN = (1 << 22) - 1
_RATE = (65536 / (np.arange(1024).clip(0, LIMIT) + 1.5)).astype(np.int64)
_ONE = np.uint64(1)
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_SHARE = np.uint64(16)
NUMBER = 19
"""Contexts of a number: equal, side, nearest on either side (2), exponent (9), mantissa (6)."""
_EXPONENT, _MANTISSA = 4, 13
_LARGEST = 24
"""Exponent at which a number cannot be one of ours."""


def _peek(kind: Any) -> Any:
    """A load of entry `index` of numbers of a numba type, as int64."""

    @intrinsic
    def peek(typing, address, index):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            pointer = context.get_data_type(kind).as_pointer()
            start = builder.inttoptr(arguments[0], pointer)
            value = builder.load(builder.gep(start, [arguments[1]]))
            return context.cast(builder, value, kind, types.int64)

        return types.int64(types.int64, types.int64), generate

    return peek


def _poke(kind: Any) -> Any:
    """A store of the low bits of an int64 as entry `index` of numbers of a numba type."""

    @intrinsic
    def poke(typing, address, index, value):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            pointer = context.get_data_type(kind).as_pointer()
            start = builder.inttoptr(arguments[0], pointer)
            low = context.cast(builder, arguments[2], types.int64, kind)
            builder.store(low, builder.gep(start, [arguments[1]]))
            return context.get_dummy_value()

        return types.void(types.int64, types.int64, types.int64), generate

    return poke


peek16 = _peek(types.int16)

peek32 = _peek(types.uint32)

poke16 = _poke(types.int16)

poke32 = _poke(types.uint32)


@intrinsic
def _trailing_zeros(typing, word):  # type: ignore[no-untyped-def]
    """Index of the lowest set bit of a non-zero uint32, as int64."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        place = builder.cttz(arguments[0], cgutils.true_bit)
        return context.cast(builder, place, types.uint32, types.int64)

    return types.int64(types.uint32), generate


trailing_zeros: Any = _trailing_zeros


"""State of each context: probability of a zero, 22 bits, then the decisions seen, 10 bits."""


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


@njit(cache=True, nogil=True, inline="always")
def put_number(decisions, n, base, d):  # type: ignore[no-untyped-def]
    """Appends the decisions of d at place n; the place after them.

    decisions: address of uint16, twice the context plus the bit. base: first of NUMBER contexts.
    """
    unequal = 1 if d else 0
    side = 1 if d > 0 else 0
    far = abs(d) - 1
    poke16(decisions, n, (base << 1) | unequal)  # what is not counted is written over
    poke16(decisions, n + 1, ((base + 1) << 1) | side)
    poke16(decisions, n + 2, ((base + 2 + side) << 1) | (1 if far > 0 else 0))
    n += 1 + 2 * unequal
    if far > 0:
        far += 1
        exponent = 1
        while far >> (exponent + 1):
            poke16(decisions, n, ((base + _EXPONENT + min(exponent - 1, 8)) << 1) | 1)
            n += 1
            exponent += 1
        poke16(decisions, n, (base + _EXPONENT + min(exponent - 1, 8)) << 1)
        n += 1
        context = base + _MANTISSA + min(exponent - 1, 4)
        for place in range(exponent - 1, -1, -1):
            poke16(decisions, n, (context << 1) | ((far >> place) & 1))
            n += 1
            context = base + _MANTISSA + 5
    return n


@njit(cache=True, nogil=True, inline="always")
def get_number(words, size, model, base, code, span, at):  # type: ignore[no-untyped-def]
    """(d, code, span, place) of the number that `put_number` made decisions of.

    words, model: addresses of uint32; size: number of words.
    """
    d, more, side = 0, 0, 0
    unequal, code, span, at = decode_bit(words, size, model, base, code, span, at)
    if unequal:
        side, code, span, at = decode_bit(words, size, model, base + 1, code, span, at)
        more, code, span, at = decode_bit(words, size, model, base + 2 + side, code, span, at)
        d = 1
    if more:
        exponent = 0
        while more and exponent < _LARGEST:
            context = base + _EXPONENT + min(exponent, 8)
            more, code, span, at = decode_bit(words, size, model, context, code, span, at)
            exponent += 1
        context = base + _MANTISSA + min(exponent - 1, 4)
        for _ in range(exponent):
            bit, code, span, at = decode_bit(words, size, model, context, code, span, at)
            d = 2 * d + bit
            context = base + _MANTISSA + 5
    return d if side else -d, code, span, at
