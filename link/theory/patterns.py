"""Distribution of a pixel's spikes over a few ticks of varying light, with hard reset: closed form.

Between resets charge only grows. A pixel that was emptied before tick i has therefore not spiked by
the end of tick j if and only if the electrons of i to j are fewer than its threshold: a renewal
process with independent intervals (Cox, Renewal Theory, 1962). Under Poisson light of any course
the smooth charge at which a threshold of q electrons is reached is Gamma(q) distributed; threshold
noise widens it. The distribution is computed from the cube root, which is normal to within 1e-4 for
q from 20 (Wilson and Hilferty, PNAS 17:684, 1931).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def survival(charge: npt.ArrayLike, q: float, noise: float = 0.0) -> Array:
    """P(no spike yet) of a pixel that started empty.

    Args:
        charge: mean charge since then, in thresholds.
        q: threshold, electrons.
        noise: standard deviation of the threshold, electrons.
    """
    from scipy.special import ndtr

    shape = q * q / (q + noise * noise)
    level = np.cbrt(np.maximum(charge, 0.0)) - (1 - 1 / (9 * shape))
    return np.asarray(ndtr(-3 * np.sqrt(shape) * level), np.float64)


def hard_patterns(means: Array, window: int, q: float, noise: float = 0.0) -> Array:
    """P(pattern of the last `window` ticks), (..., 2^window).

    Bit j of a pattern is the spike of tick j of the window. The pixel is empty before the first
    tick.

    Args:
        means: (..., ticks) mean electrons of each tick over q electrons.
        window: number of ticks of the pattern.
        q, noise: probability and noise as in `survival`.
    """
    ticks = means.shape[-1]
    if not 1 <= window <= ticks:
        raise ValueError(f"window must be 1 to the {ticks} ticks given, not {window}")
    total = np.concatenate([np.zeros((*means.shape[:-1], 1)), np.cumsum(means, axis=-1)], axis=-1)
    first, last_one = np.triu_indices(ticks + 1, 1)
    gone = survival(total[..., last_one] - total[..., first], q, noise)
    alive = {
        pair: gone[..., n]
        for n, pair in enumerate(zip(first.tolist(), last_one.tolist(), strict=True))
    }
    one = np.ones(means.shape[:-1])
    alive |= {(i, i): one for i in range(ticks + 1)}  # an empty interval
    fresh = [one]  # P(reset just before a tick)
    for j in range(ticks - window):
        fresh.append(_fires(fresh, alive, j))
    out = np.zeros((*means.shape[:-1], 1 << window))
    start = ticks - window
    # (pattern, last, P(spikes of the pattern, the last one just before tick `last`))
    reached: list[tuple[int, int, Array]] = []
    out[..., 0] = sum(f * alive[i, ticks] for i, f in enumerate(fresh))
    for j in range(start, ticks):
        bit = 1 << (j - start)
        reached_now = [(bit, j + 1, _fires(fresh, alive, j))]
        reached_now += [
            (pattern | bit, j + 1, chance * (alive[last, j] - alive[last, j + 1]))
            for pattern, last, chance in reached
        ]
        reached += reached_now
    for pattern, last, chance in reached:
        out[..., pattern] = chance * alive[last, ticks]
    return out


def _fires(fresh: list[Array], alive: dict[tuple[int, int], Array], j: int) -> Array:
    """P(spike in tick j, and none since one of the `fresh` resets)."""
    return np.asarray(sum(f * (alive[i, j] - alive[i, j + 1]) for i, f in enumerate(fresh)))
