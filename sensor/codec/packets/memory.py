"""Bits of words and numbers at an address, as single instructions in compiled code.

numba counts references to an array wherever inlined code takes a branch, which costs more than a
decision of the range coder. So the inner loops take the addresses of arrays, whose life and size
their caller guarantees.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

__all__ = ["peek16", "peek32", "peek64", "poke16", "poke32", "trailing_zeros"]


def _peek(bits: int, signed: bool) -> Any:
    """A load of entry `index` of numbers of `bits` bits, as int64."""

    @intrinsic
    def peek(typing, address, index):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            kind = ir.IntType(bits)
            start = builder.inttoptr(arguments[0], kind.as_pointer())
            value = builder.load(builder.gep(start, [arguments[1]]))
            wide = ir.IntType(64)
            if bits == 64:
                return value
            return builder.sext(value, wide) if signed else builder.zext(value, wide)

        return types.int64(types.int64, types.int64), generate

    return peek


def _poke(bits: int) -> Any:
    """A store of the low `bits` bits of an int64."""

    @intrinsic
    def poke(typing, address, index, value):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            kind = ir.IntType(bits)
            start = builder.inttoptr(arguments[0], kind.as_pointer())
            low = builder.trunc(arguments[2], kind)
            builder.store(low, builder.gep(start, [arguments[1]]))
            return context.get_dummy_value()

        return types.void(types.int64, types.int64, types.int64), generate

    return poke


peek16 = _peek(16, signed=True)
peek32 = _peek(32, signed=False)
peek64 = _peek(64, signed=True)
poke16 = _poke(16)
poke32 = _poke(32)


@intrinsic
def trailing_zeros(typing, word):  # type: ignore[no-untyped-def]
    """Index of the lowest set bit of a non-zero uint32, as int64."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        flag = ir.Constant(ir.IntType(1), 1)
        return builder.zext(builder.cttz(arguments[0], flag), ir.IntType(64))

    return types.int64(types.uint32), generate
