"""Whole numbers as decisions of the range coder, compiled.

A number beside its expectation: whether it is equal, on which side it lies, and how far away, in
Elias's gamma code, the exponent in unary. Each of these decisions has a context of its own, so that
the shape of the law is learned, whatever it is, also where the expectation lies between two whole
numbers.
"""

from __future__ import annotations

from numba import njit

from sensor.codec.packets.memory import poke16
from sensor.codec.packets.ranges import decode_bit

NUMBER = 19
"""Contexts of a number: equal, side, nearest on either side (2), exponent (9), mantissa (6)."""
_EXPONENT, _MANTISSA = 4, 13
_LARGEST = 24
"""Exponent at which a number cannot be one of ours."""


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
