"""Bits of words and numbers at an address, as single instructions in compiled code.

numba counts references to an array wherever inlined code takes a branch, which costs more than a
decision of the range coder. So the inner loops take the addresses of arrays, whose life and size
their caller guarantees.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic


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
