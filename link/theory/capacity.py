"""Capacity of photon counting and of one-bit slots, bits."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.theory.charge import poisson_threshold

Array = npt.NDArray[np.float64]
_FAR: Final = 1e5
"""Ratio of background to signal above which series are used; both forms are accurate to 1e-10
there."""


def poisson_best_duty(dark: npt.ArrayLike) -> Array:
    """Optimal share of time at peak power: (1+s)^(1+s) / (s^s e) - s.

    It rises from 1/e to 1/2 as s = dark / peak goes from 0 to infinity. The form used neither
    overflows nor cancels.
    """
    from scipy.special import xlogy

    s = np.asarray(dark, np.float64)
    low = np.minimum(s, 1.0)
    dim = np.exp((1 + low) * np.log1p(low) - xlogy(low, low) - 1) - low
    # s (e^x - 1), x the exponent minus ln s: for a large s the difference above cancels.
    near = np.clip(s, 1.0, _FAR)
    bright = near * np.expm1((1 + near) * np.log1p(1 / near) - 1)
    far = 1 / np.maximum(s, _FAR)
    return np.select([s < 1, s < _FAR], [dim, bright], 0.5 - far / 24 + far * far / 48)


def poisson_capacity(dark: npt.ArrayLike, average: npt.ArrayLike | None = None) -> Array:
    """Capacity of a peak-limited Poisson channel, bits per peak photon (C / A).

    C / A = q (1+s) ln(1+s) + (1-q) s ln s - (q+s) ln(q+s) nats, q = min(average, best duty)
    (Kabanov, Theory Probab. Appl. 23:143, 1978; Davis, IEEE Trans. IT 26:710, 1980; Wyner, IEEE
    Trans. IT 34:1449, 1988). The input bandwidth is unlimited; an input that is constant over a
    slot of many photons does not reach this capacity.

    Args:
        dark: background rate over the peak rate A.
        average: limit of the mean rate over A; None for no limit.
    """
    s = np.asarray(dark, np.float64)
    most = np.asarray(1.0 if average is None else average, np.float64)
    if not (s >= 0).all() or not (most >= 0).all():
        raise ValueError("dark and average must be at least 0")
    q = np.minimum(poisson_best_duty(s), most)
    return np.asarray(_mutual(s, q) / np.log(2))


def _mutual(s: Array, q: Array) -> Array:
    """Mutual information of `poisson_capacity` for duty q, nats per peak photon.

    It is computed as q (1+s) ln((1+s)/(q+s)) + (1-q) s ln(s/(q+s)), which does not contain s ln s:
    that term cancels for a large s. The two remaining terms are close to q (1 - q), and their sum
    to q (1 - q) / (2 s); for a large s its series is used.
    """
    near = np.minimum(s, _FAR)
    total = np.where(near + q > 0, near + q, 1.0)
    above = np.where(near > 0, near, 1.0)
    dark = np.where(near > 0, near * np.log1p(q / above), 0.0)
    exact = q * (1 + near) * np.log1p((1 - q) / total) - (1 - q) * dark
    far = 1 / np.maximum(s, _FAR)
    series = q * (1 - q) * far / 2 * (1 - (1 + q) * far / 3)
    return np.where(s < _FAR, exact, series)


def binary_capacity(p01: npt.ArrayLike, p10: npt.ArrayLike) -> tuple[Array, Array]:
    """(bits per use, optimal share of ON) of a memoryless binary channel.

    The channel reads OFF as ON with p01 and ON as OFF with p10. Closed form (Silverman, IRE Trans.
    IT 1:19, 1955): with z = exp((h(p01) - h(p10)) / (1 - p01 - p10)) in nats, P(read ON) = 1 / (1 +
    z') at the optimum. A channel whose output is independent of its input (p01 + p10 = 1) has
    capacity 0.
    """
    from scipy.special import entr

    a, b = (np.asarray(p, np.float64) for p in np.broadcast_arrays(p01, p10))
    if (a < 0).any() or (a > 1).any() or (b < 0).any() or (b > 1).any():
        raise ValueError("p01 and p10 must be 0 to 1")
    slope = 1 - a - b
    blind = np.abs(slope) < 1e-12
    gap = np.where(blind, 1.0, slope)
    h0, h1 = entr(a) + entr(1 - a), entr(b) + entr(1 - b)
    read = 1 / (1 + np.exp((h1 - h0) / gap))
    share = np.clip((read - a) / gap, 0.0, 1.0)
    read = share * (1 - b) + (1 - share) * a
    bits = (entr(read) + entr(1 - read) - share * h1 - (1 - share) * h0) / np.log(2)
    return np.where(blind, 0.0, np.maximum(bits, 0.0)), np.where(blind, 0.5, share)


def one_bit_capacity(
    q: npt.ArrayLike, mean_on: npt.ArrayLike, mean_off: npt.ArrayLike = 0.0
) -> Array:
    """Capacity of a pixel that starts each tick empty, bits per tick.

    The output of a tick is whether q electrons arrived.
    """
    return binary_capacity(*poisson_threshold(q, mean_on, mean_off))[0]


def count_capacity(off: Array, on: Array) -> tuple[float, float]:
    """(bits per use, optimal share of ON) of a channel with two inputs.

    The mutual information is concave in the share, so its maximum is the root of D(on | mix) -
    D(off | mix), found by bisection.

    Args:
        off, on: (outputs,) probabilities of the output for each input.
    """
    from scipy.special import rel_entr

    def gap(share: float) -> tuple[float, float]:
        mix = share * on + (1 - share) * off
        return float(rel_entr(off, mix).sum()), float(rel_entr(on, mix).sum())

    low, high = 0.0, 1.0
    for _ in range(60):
        share = (low + high) / 2
        dark, light = gap(share)
        low, high = (share, high) if light > dark else (low, share)
    share = (low + high) / 2
    dark, light = gap(share)
    bits = (share * light + (1 - share) * dark) / float(np.log(2))
    return min(max(bits, 0.0), 1.0), share
