"""Sum of four by four taps in vector instructions: one multiplication for each row of taps.

Numba has no vectors of its own, so the instructions are stated to its compiler.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_LANE = ir.IntType(32)


@intrinsic
def _four_by_four(typing, weights, first, plane, place, stride):  # type: ignore[no-untyped-def]
    """Sum of 16 products, float32; for compiled code only, and without bound checks.

    The products are added row by row in each column, then (column 0 + 1) + (column 2 + 3).

    Args:
        weights: (n,) float32, row-major sets of 16 weights.
        first: index of the set's first weight, uint64.
        plane: (m,) float32, a flat plane.
        place: index in `plane` of the first tap, uint64.
        stride: elements of a row of the plane, uint64.
    """

    def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
        four = ir.VectorType(ir.FloatType(), 4)

        def load(array, index):  # type: ignore[no-untyped-def]
            data = context.make_array(signature.args[array])(context, builder, args[array]).data
            at = builder.bitcast(builder.gep(data, [index]), four.as_pointer())
            return builder.load(at, align=4)

        _, weight, _, tap, step = args
        total = builder.fmul(load(0, weight), load(2, tap))
        for row in range(1, 4):
            tap = builder.add(tap, step)
            row_of_weights = load(0, builder.add(weight, ir.Constant(weight.type, 4 * row)))
            total = builder.fadd(total, builder.fmul(row_of_weights, load(2, tap)))
        a, b, c, d = (builder.extract_element(total, ir.Constant(_LANE, n)) for n in range(4))
        return builder.fadd(builder.fadd(a, b), builder.fadd(c, d))

    return types.float32(weights, first, plane, place, stride), generate


four_by_four: Any = _four_by_four
