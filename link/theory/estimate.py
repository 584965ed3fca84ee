"""What a run's error rate is compared with: a symbol of several ticks on several pixels, estimated.

An estimate, and said to be: shot noise alone, every pixel of a cell alike and independent, light
constant within a tick, runs of geometric lengths up to the line code's limit. Not in it: threshold
noise, crosstalk, blur between cells, ticks that two symbols share, patterns of gain, vibration.
The law of one pixel's charge through runs of ON and OFF symbols is followed exactly.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from link.theory.charge import Reset, charge_kernels

__all__ = ["count_laws", "pixel_errors"]

Array = npt.NDArray[np.float64]
_FINEST: Final = 1000
"""Electrons of a threshold that are counted one by one; a larger one is scaled down to it, means
with it, which has more shot noise than the truth: more errors where the means of ON and OFF lie on
both sides of the threshold."""
_DEPTH: Final = 4
"""Thresholds of waiting charge with `subtract`."""
_ROUNDS: Final = 60
"""Pairs of runs in which the charge at a run's begin settles."""


def _symbol(law: Array, kernel: Array, ticks: int) -> Array:
    """(ticks + 1, states): law of (spikes, charge) after a symbol that begins with this law."""
    out = np.zeros((ticks + 1, law.size))
    out[0] = law
    for _ in range(ticks):
        spiked = out @ kernel[1]
        out = out @ kernel[0]
        out[1:] += spiked[:-1]
    return out


def count_laws(
    q: float, mu_on: float, mu_off: float, reset: Reset, ticks: int = 1, longest: int | None = 5
) -> tuple[Array, Array]:
    """Laws of a pixel's spikes in an OFF and in an ON symbol, (ticks + 1,) each.

    q, mu_on, mu_off: electrons, a tick. longest: symbols of a run; None: 40, as good as no limit.
    Runs of r symbols have shares ~ 2^-r, as random bits have.
    """
    scale = max(q / _FINEST, 1.0)
    whole = max(round(q / scale), 1)
    off, on = (charge_kernels(reset, whole, m / scale, _DEPTH) for m in (mu_off, mu_on))
    runs = np.arange(1, (longest or 40) + 1)
    share = 0.5**runs / (0.5**runs).sum()
    at = np.cumsum(share[::-1])[::-1]  # P(a run has an r-th symbol)
    at = at / at.sum()
    law = np.full(off.shape[1], 1.0 / off.shape[1])  # what residual keeps; hard soon forgets it
    counts = [np.zeros(ticks + 1), np.zeros(ticks + 1)]
    for _ in range(_ROUNDS):
        before = law
        for bit, kernel in enumerate((off, on)):
            counts[bit] = np.zeros(ticks + 1)
            after = np.zeros_like(law)
            for r in range(runs.size):
                symbol = _symbol(law, kernel, ticks)
                counts[bit] += at[r] * symbol.sum(1)
                law = symbol.sum(0)
                after += share[r] * law
            law = after
        if np.abs(law - before).sum() < 1e-12:
            break
    return counts[0], counts[1]


def _of_pixels(law: Array, pixels: int) -> Array:
    """Law of the sum over independent pixels."""
    out = np.ones(1)
    for _ in range(pixels):
        out = np.convolve(out, law)
    return out


def pixel_errors(
    q: float,
    mu_on: float,
    mu_off: float,
    reset: Reset = "hard",
    ticks: int = 1,
    pixels: int = 1,
    *,
    longest: int | None = 5,
    rule: Literal["joint", "majority"] = "joint",
) -> tuple[float, float]:
    """Estimated (p01, p10) of a symbol of `ticks` ticks on a cell of `pixels` camera pixels, from
    its count of spikes: P(decided ON | OFF), P(decided OFF | ON).

    joint decides for ON from the count on that errs least, as a sum of log-likelihood ratios does
    over looks that are alike; majority from more than half of all ticks and pixels on. For one
    pixel and tick, a whole threshold up to 1000 and runs of that law the pixel's own rates; longest
    is 5 of 8B10B, 4 of 4B6B, 2 of Manchester.
    """
    if q < 1 or mu_on < 0 or mu_off < 0 or ticks < 1 or pixels < 1 or (longest or 1) < 1:
        raise ValueError(
            "q, ticks, pixels and longest must be at least 1 and the means at least 0, not "
            f"{q}, {ticks}, {pixels}, {longest}, {mu_on}, {mu_off}"
        )
    off, on = (_of_pixels(x, pixels) for x in count_laws(q, mu_on, mu_off, reset, ticks, longest))
    # P(count >= m | off) and P(count < m | on), m = 1 .. ticks pixels, summed from the small end.
    false = np.cumsum(off[::-1])[::-1][1:]
    missed = np.cumsum(on)[:-1]
    m = ticks * pixels // 2 if rule == "majority" else int(np.argmin(false + missed))
    return float(min(false[m], 1.0)), float(min(missed[m], 1.0))
