"""Estimated error rate of a symbol of several ticks on several pixels, for comparison with runs.

Assumptions: shot noise only, all pixels of a cell alike and independent, light constant within a
tick, run lengths geometric up to the limit of the line code. Not included: threshold noise,
crosstalk, blur between cells, ticks shared by two symbols, patterns of gain, vibration. The
distribution of one pixel's charge through runs of ON and OFF symbols is exact.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from link.theory.charge import Reset, charge_kernels

Array = npt.NDArray[np.float64]
_FINEST: Final = 1000
"""Largest threshold that is modelled electron by electron. A larger one is scaled down together
with the means, which overstates shot noise: more errors if the ON and OFF means lie on either side
of the threshold."""
_DEPTH: Final = 4
"""Number of thresholds of waiting charge with `subtract`."""
_ROUNDS: Final = 60
"""Number of run pairs in which the charge at the start of a run converges."""


def _symbol(law: Array, kernel: Array, ticks: int) -> Array:
    """Distribution of (spikes, charge) after a symbol, (ticks + 1, states).

    Args:
        law: (states,) distribution of the charge before.
        kernel: (2, states, states) of a tick.
        ticks: ticks of a symbol.
    """
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
    """Distributions of a pixel's spikes in an OFF and in an ON symbol, (ticks + 1,) each.

    Runs of r symbols have shares ~ 2^-r, as in random bits.

    Args:
        q: threshold, electrons.
        mu_on, mu_off: mean electrons of a tick.
        reset: reset rule.
        ticks: ticks of a symbol.
        longest: longest run of equal symbols; None for 40, practically no limit.
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
    """Distribution of the sum over independent pixels."""
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
    """Estimated (p01, p10) of a symbol on a cell: P(read ON | OFF), P(read OFF | ON).

    The decision is on the total count of spikes. For one pixel, one tick, an integer threshold up
    to 1000 and runs of this distribution, the result is exact.

    Args:
        q: threshold, electrons.
        mu_on, mu_off: mean electrons of a tick.
        reset: reset rule.
        ticks: ticks of a symbol.
        pixels: camera pixels of a cell.
        longest: longest run of equal symbols: 5 for 8B10B, 4 for 4B6B, 2 for Manchester.
        rule: "joint" decides ON from the count with the fewest errors, as a sum of log likelihood
            ratios does over identical observations; "majority" from more than half of all ticks and
            pixels.
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
