"""Forward-backward recursion on a pixel's charge, and its likelihood under known bits.

Bahl, Cocke, Jelinek and Raviv, IEEE Trans. Inf. Theory 20:284 (1974), on the states (charge, bit of
the current symbol). A spike shows that the charge passed the threshold; the excess remains
(residual) or is lost (hard).

The recursions take the arrays of `ChargeLaws` as separate arguments: they run a thousand times for
each bit, and records would slow the innermost loop.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from link.detect.counting import PHASES

_ALIGNED: Final = 1e-6
"""Distance from a tick edge within which a symbol counts as beginning with the tick, ticks."""


@njit(cache=True, nogil=True)
def _prior(after, before, begins, known, pairs, symbol):  # type: ignore[no-untyped-def]
    """Probability of a bit after a tick, given that before it.

    Args:
        after, before: bits after and before the tick.
        begins: whether a symbol begins in the tick.
        known: the symbol's bit, -1 if unknown.
        pairs: whether symbols come in Manchester pairs.
        symbol: number of the symbol.
    """
    if not begins:
        return 1.0 if after == before else 0.0
    if known >= 0:
        return 1.0 if after == known else 0.0
    if pairs and symbol % 2 == 1:  # the second half of a Manchester pair
        return 1.0 if after != before else 0.0
    return 0.5


@njit(cache=True, nogil=True)
def _forward(  # type: ignore[no-untyped-def]
    now, then, spike, s, f, begins, known, pairs, symbol, chance, low, high, merged, levels, hard
):
    """Computes one tick of the forward pass: `then` (2, levels) from `now`.

    Returns the sum of `then` before it is normalised.
    """
    then[:] = 0.0
    for after in range(2):
        for before in range(2):
            weight = _prior(after, before, begins, known, pairs, symbol)
            if merged and begins and known < 0 and not (pairs and symbol % 2 == 1):
                if before == 1:
                    continue  # both bits are handled together, with bit 0
                both = True
            else:
                both = False
            if weight == 0.0:
                continue
            first, stop = low[s, f, before, after], high[s, f, before, after]
            for g in range(levels):
                mass = weight * (now[0, g] + now[1, g] if both else now[before, g])
                if mass < 1e-15:
                    continue
                if not spike:
                    for d in range(first, min(stop, levels - g)):
                        then[after, g + d] += mass * chance[s, f, before, after, d]
                elif hard:
                    for d in range(max(first, levels - g), stop):
                        then[after, 0] += mass * chance[s, f, before, after, d]
                else:
                    for d in range(max(first, levels - g), stop):
                        to = g + d - levels
                        while to >= levels:
                            to -= levels
                        then[after, to] += mass * chance[s, f, before, after, d]
    total = then.sum()
    if total > 0.0:
        then /= total
    else:  # impossible under these laws: all states become equally likely
        then[:] = 0.5 / levels
    return total


@njit(cache=True, nogil=True)
def _backward(  # type: ignore[no-untyped-def]
    later, now, spike, s, f, begins, known, pairs, symbol, chance, low, high, levels, hard
):
    """Computes one tick of the backward pass: `now` (2, levels) from `later`.

    The values are the probabilities of the later spikes, given the state.
    """
    now[:] = 0.0
    for after in range(2):
        for before in range(2):
            weight = _prior(after, before, begins, known, pairs, symbol)
            if weight == 0.0:
                continue
            first, stop = low[s, f, before, after], high[s, f, before, after]
            for g in range(levels):
                total = 0.0
                if not spike:
                    for d in range(first, min(stop, levels - g)):
                        total += chance[s, f, before, after, d] * later[after, g + d]
                elif hard:
                    for d in range(max(first, levels - g), stop):
                        total += chance[s, f, before, after, d] * later[after, 0]
                else:
                    for d in range(max(first, levels - g), stop):
                        to = g + d - levels
                        while to >= levels:
                            to -= levels
                        total += chance[s, f, before, after, d] * later[after, to]
                now[before, g] += weight * total
    most = now.sum()
    if most > 0.0:
        now /= most
    else:
        now[:] = 0.5 / levels


@njit(cache=True, nogil=True)
def likelihood(  # type: ignore[no-untyped-def]
    train, fraction, symbol, known, s, chance, low, high, merged, levels, hard
):
    """ln P(train | bits).

    Args:
        train: (ticks,) spikes.
        fraction: (ticks,) index of the fraction of the tick at which a symbol begins; the last
            index for none.
        symbol: (ticks,) symbol at the end of the tick.
        known: (symbols,) int8 bits, -1 if unknown.
        s: class of share.
        chance, low, high, merged, levels, hard: tables of `ChargeLaws`.
    """
    none = merged.size - 1
    now, then = np.full((2, levels), 0.5 / levels), np.empty((2, levels))
    total = 0.0
    # np.bool_ as in `posterior`: a plain constant would have `_forward` compiled a second time.
    for k in range(train.size):
        f, n = fraction[k], symbol[k]
        sure = known[n] if 0 <= n < known.size else -1
        chanced = _forward(
            now, then, train[k] > 0, s, f, f < none, sure, np.bool_(False), n, chance, low, high,
            merged[f], levels, hard,
        )  # fmt: skip
        total += np.log(max(chanced, 1e-30))
        now, then = then, now
    return total


@njit(cache=True, nogil=True)
def posterior(  # type: ignore[no-untyped-def]
    train, fraction, symbol, pairs, s, chance, low, high, merged, levels, hard, states, out
):
    """Writes ln P(on | train) - ln P(off | train) of the symbols to `out`, (symbols,).

    With random bits this is the log likelihood ratio.

    Args:
        train, fraction, symbol: spike train, fraction and symbol as in `likelihood`.
        pairs: whether symbols come in Manchester pairs that begin at even symbols.
        s: class of share.
        chance, low, high, merged, levels, hard: tables of `ChargeLaws`.
        states: (ticks + 1, 2, levels) float64, memory for the forward pass.
    """
    none, ticks = merged.size - 1, train.size
    states[0] = 0.5 / levels
    for k in range(ticks):
        f = fraction[k]
        _forward(
            states[k], states[k + 1], train[k] > 0, s, f, f < none, np.int64(-1), pairs, symbol[k],
            chance, low, high, merged[f], levels, hard,
        )  # fmt: skip
    later, now = np.full((2, levels), 0.5 / levels), np.empty((2, levels))
    for k in range(ticks - 1, -1, -1):
        f, n = fraction[k], symbol[k]
        if f < none and 0 <= n < out.size:  # the symbol begins here
            on, off = 0.0, 0.0
            for g in range(levels):
                off += states[k + 1, 0, g] * later[0, g]
                on += states[k + 1, 1, g] * later[1, g]
            out[n] = np.log(max(on, 1e-30)) - np.log(max(off, 1e-30))
        _backward(
            later, now, train[k] > 0, s, f, f < none, -1, pairs, n, chance, low, high, levels, hard
        )
        later, now = now, later


@njit(cache=True, nogil=True)
def window(first, period, slope, rows, row, symbol, symbols, start, fraction, under_way):  # type: ignore[no-untyped-def]
    """Fills `fraction` and `under_way`, (ticks,), as `likelihood` reads them.

    Args:
        first, period, slope, rows: first, period, slope and rows of the timing.
        row: camera row.
        symbol, symbols: first symbol, number 0 of `under_way`, and number of symbols.
        start: tick of the first entry.
    """
    fraction[:] = PHASES + 1
    under_way[:] = -1
    for n in range(symbols + 2):
        begin = first + (symbol + n) * period + slope * row / rows
        tick = int(np.floor(begin + _ALIGNED))
        delay = begin - tick
        k = tick - start
        if 0 <= k < fraction.size:
            fraction[k] = 0 if delay < _ALIGNED else 1 + min(int(delay * PHASES), PHASES - 1)
        under_way[max(k, 0) :] = n
