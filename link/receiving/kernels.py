"""Loops over single bits, compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["likelihood"]

_ROOT = 1 / math.sqrt(2)


@njit(cache=True)
def likelihood(  # type: ignore[no-untyped-def]
    bits, light, start, tick, period, on, background, rule, noise, floor, skip
):
    """ln P of observed bits of each pixel, (n,), of bits (n, ticks) uint8 of pixels whose
    light in each symbol is (n, symbols) float64; start (n,): tick at which symbol 0 begins for
    each. rule: of the reset, 0 residual, 1 hard, 2 subtract."""
    count, ticks = bits.shape
    symbols = light.shape[1]
    out = np.zeros(count)
    for i in range(count):
        charge = 0.5
        total = 0.0
        for k in range(ticks):
            at = (tick + k - start[i]) / period
            whole = math.floor(at)
            share = (at - whole) * period + 1 - period
            share = min(max(share, 0.0), 1.0)
            n = min(max(int(whole), 0), symbols - 1)
            m = min(n + 1, symbols - 1)
            charge += on * ((1 - share) * light[i, n] + share * light[i, m]) + background
            fired = bits[i, k] != 0
            if k >= skip:
                z = (charge - 1) / noise * _ROOT
                p = 0.5 * math.erfc(-z if fired else z)
                total += np.log(floor + (1 - 2 * floor) * p)
            if fired:
                charge = 0.0 if rule == 1 else max(charge - 1, 0.0)
                if rule == 0:
                    charge -= math.floor(charge)
            elif charge > 1:
                charge = 1.0
        out[i] = total
    return out
