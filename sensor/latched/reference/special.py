"""Special functions of scipy for compiled loops.

They are called by address, so that numba can cache the compiled loops.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import get_cython_function_address, intrinsic


def address(name: str) -> np.int64:
    """Address of a function of doubles in scipy.special.cython_special.

    The address changes from process to process, so compiled code takes it as an argument and never
    as a constant.
    """
    return np.int64(get_cython_function_address("scipy.special.cython_special", name))


def _call(builder: Any, args: list[Any]) -> Any:
    double, flag = ir.DoubleType(), ir.IntType(32)
    kind = ir.FunctionType(double, [double] * (len(args) - 1) + [flag])
    function = builder.inttoptr(args[0], kind.as_pointer())
    return builder.call(function, [*args[1:], ir.Constant(flag, 0)])


def _one(typing, where, x):  # type: ignore[no-untyped-def]
    def build(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _call(builder, args)

    return types.float64(types.int64, types.float64), build


def _two(typing, where, a, x):  # type: ignore[no-untyped-def]
    def build(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _call(builder, args)

    return types.float64(types.int64, types.float64, types.float64), build


call_one: Any = intrinsic(_one)
"""call_one(address, x): f(x) of the function at the address."""
call_two: Any = intrinsic(_two)
"""call_two(address, a, x): f(a, x) of the function at the address."""
