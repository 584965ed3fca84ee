"""The dynamic range of a spike camera, and what its threshold and widths resolve (Huang, "Spiking
Continuous Photographing Principle", Acta Electronica Sinica 50:2919, 2022, sections 3.3.2 to 5.2).

A pixel gathers Q electrons in a width tau, so light is Q/tau. The shortest width is what the
circuit can read out, the longest what dark current leaves of it: Q/I_dark.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.radiometry import photons_per_lux
from sensor.dynamic_range.parts import as_ratio, decibels

Widths = npt.NDArray[np.float64]


_NODES: Final = 401
"""Nodes of the integral over the pixels of a fixed pattern."""
_MOST: Final = 6.0
"""Standard deviations of that integral on both sides."""


def spike_dynamic_range(longest: float, shortest: float, levels: float = 1) -> float:
    """20 lg(longest/shortest N), dB (sections 4.4 and 4.5): widths in one unit of time; levels: N
    of the charge read below threshold when the longest width is up, 1 for none."""
    return decibels(longest / shortest * levels)


def levels_for(db: float, longest: float, shortest: float) -> float:
    """N that a dynamic range takes when a width may be no longer than this: 10 for 180 dB at 1 s
    and 10 ns. At 0.1 s it is 100, where section 4.5 prints 10."""
    return as_ratio(db) / (longest / shortest)


def photons_per_second(lux: float, square_micrometres: float) -> float:
    """Photons a second on a pixel, as of 555 nm (section 4.3)."""
    return photons_per_lux(555) * lux * square_micrometres * 1e-12


def threshold_for(electrons_per_second: float, shortest: float) -> float:
    """The least Q with which a circuit of this shortest width, seconds, follows the light."""
    return electrons_per_second * shortest


def longest_width(threshold: float, dark: float) -> float:
    """Seconds after which a width is dark current's rather than light's: Q/I_dark (section 4.4).
    dark: electrons a second."""
    return threshold / dark


def seen_dark_share(limit: int, width: float, noise: float, pattern: float = 0.0) -> float:
    """Share of the pixels in the dark whose interval at an instant is latched below a limit.

    A width in the dark has the law of the threshold, Gamma(a) of mean `width` with a = noise^-2,
    which is Q from shot noise alone. The interval that holds an instant is the longer the likelier
    it holds it, w f(w) / E w: Gamma(a + 1). A clock latches a width w as one of the two whole
    numbers around it, floor(w + u) with a uniform u, so the share below L is the mean of the
    distribution function over [L - 1, L]. The mean over the pixels is taken for a normal pattern.

    Args:
        limit: least width in cycles that is rejected.
        width: mean width in the dark, cycles.
        noise: standard deviation of a pixel's width over its mean.
        pattern: standard deviation of the dark currents of the pixels over their mean.
    """
    from scipy.special import gammainc

    normal = np.linspace(-_MOST, _MOST, _NODES) if pattern else np.zeros(1)
    current = 1 + pattern * normal
    weight = np.exp(-normal * normal / 2)[current > 0]  # the others never fire
    widths = width / current[current > 0]

    def below(end: int) -> Widths:  # the integral of the distribution function up to `end`
        if not noise:
            return np.maximum(end - widths, 0)
        a = noise**-2
        scaled = end * a / widths
        rest = (a + 1) / a * widths * gammainc(a + 2, scaled)
        return np.asarray(end * gammainc(a + 1, scaled) - rest)

    seen = np.clip(below(limit) - below(limit - 1), 0.0, 1.0)
    return float((seen * weight).sum() / np.exp(-normal * normal / 2).sum())


def dark_limit(share: float, width: float, noise: float, pattern: float = 0.0) -> int:
    """Largest width in cycles at and above which a rejection of intervals leaves at most `share` of
    the pixels in the dark. The others are arguments of `seen_dark_share`."""

    def beyond(limit: int) -> bool:
        return seen_dark_share(limit, width, noise, pattern) > share

    return bisect_left(range(1, math.ceil(2 * width) + 3), True, key=beyond)


def level_step(width: int) -> float:
    """Light between widths of tau and tau + 1 ticks, in Q a tick: 1/(tau (tau + 1)) (3.3.2)."""
    return 1 / (width * (width + 1))


def interval_rsd(threshold: float) -> float:
    """Standard deviation of a width over the width, from shot noise alone: sqrt(1/Q) (5.1)."""
    return math.sqrt(1 / threshold)
