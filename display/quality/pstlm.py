"""Short-term light modulation, PstLM: the IEC light flickermeter.

The method is that of IEC TR 61547-1, as in its public reference code: the light over its mean is
band-limited, weighted by the response of the eye to flicker, squared and smoothed. PstLM combines
the levels that are exceeded in certain percentages of the time. A value of 1 is the flicker that
half of the observers find irritating. All filters are second-order sections: as one polynomial, the
high-pass at 0.05 Hz would be inaccurate at high sampling rates.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from display.quality.flicker import Values, waveform

HIGH_PASS: Final = 0.05
LOW_PASS: Final = 35.0
"""Corner frequencies of Butterworth filters of order 1 and 6, Hz."""
WEIGHTING: Final = (
    (0.041661, 44.758, 2715.6, 29839.0, 0.0),
    (1.0, 196.32, 11781.0, 534820.0, 3505380.0),
)
"""Numerator and denominator of H(s), from light to visible flicker."""
SCALE: Final = 1.101603155420234e6
SMOOTHING: Final = 0.3
"""Time constant of the smoothing, s."""
SETTLING: Final = 20.0
"""Time at the start that is not evaluated, s."""
LEVELS: Final = (
    (0.0314, (0.1,)),
    (0.0525, (0.7, 1.0, 1.5)),
    (0.0657, (2.2, 3.0, 4.0)),
    (0.28, (6.0, 8.0, 10.0, 13.0, 17.0)),
    (0.08, (30.0, 50.0, 80.0)),
)
"""(weight, percentages of the time): each term is the mean of the levels exceeded in these
percentages."""
LEAST_SECONDS: Final = SETTLING + SMOOTHING / 0.007
"""Minimum length of a waveform, s: 0.7 % of the time must be at least the smoothing time. The term
of 0.1 % would need 320 s; for light that is not periodic, the difference is below the spread of the
term."""
LEAST_RATE: Final = 400.0
"""Minimum sampling rate, Hz: the bilinear transform then shifts 9 Hz by less than 0.2 %."""


def _digital(section: tuple[npt.ArrayLike, npt.ArrayLike], rate: float) -> Values:
    """A section of a filter by the bilinear transform: (6,), the coefficients of z^2, z and 1.

    Args:
        section: numerator and denominator, the coefficients of up to s^2, the highest first.
        rate: sampling rate, Hz.
    """
    double = 2 * rate  # s = 2 rate (z - 1) / (z + 1)
    above, below = (
        sum(
            c * double**n * np.poly([1.0] * n + [-1.0] * (2 - n))
            for n, c in enumerate(np.atleast_1d(part)[::-1])
        )
        for part in section
    )
    return np.concatenate([above, below]) / below[0]


def _corner(hz: float, rate: float) -> float:
    """The corner frequency, rad/s, of which the bilinear transform makes `hz`."""
    return float(2 * rate * np.tan(np.pi * hz / rate))


def _pairs(polynomial: npt.ArrayLike) -> Values:
    """The factors of second order of a polynomial of fourth order over its first coefficient,
    (2, 3): real roots with real ones, complex ones with their conjugates."""
    roots = np.roots(polynomial)
    order = np.argsort(np.abs(roots.imag), kind="stable")
    return np.array([np.poly(pair).real for pair in roots[order].reshape(-1, 2)])


@lru_cache(maxsize=8)
def _sections(rate: float) -> Values:
    """Second-order sections of all filters before the square, for the sampling rate `rate`, Hz,
    (sections, 6)."""
    high, low = _corner(HIGH_PASS, rate), _corner(LOW_PASS, rate)
    angles = np.pi / 12 * np.array([1, 3, 5])
    weight = zip(WEIGHTING[0][0] ** 0.5 * _pairs(WEIGHTING[0]), _pairs(WEIGHTING[1]), strict=True)
    analog = [
        ((1.0, 0.0), (1.0, high)),
        *((low**2, (1.0, 2 * low * np.sin(angle), low**2)) for angle in angles),
        *weight,
    ]
    return np.array([_digital(section, rate) for section in analog])


@njit(cache=True, nogil=True)
def _filtered(sections, wave):  # type: ignore[no-untyped-def]
    """`wave` after the second-order sections, in the transposed direct form II. scipy.signal has
    the same, but its import takes 0.5 s."""
    out = wave.copy()
    for b0, b1, b2, _, a1, a2 in sections:
        first = second = 0.0
        for n in range(len(out)):
            x = out[n]
            y = b0 * x + first
            first = b1 * x - a1 * y + second
            second = b2 * x - a2 * y
            out[n] = y
    return out


def pst_lm(wave: npt.ArrayLike, rate: float) -> float:
    """PstLM of light sampled at `rate`, Hz. It is 0 for steady light, and proportional to the depth
    of a modulation. Raises ValueError for less than LEAST_SECONDS or LEAST_RATE."""
    light = waveform(wave)
    seconds = len(light) / rate
    if seconds < LEAST_SECONDS or rate < LEAST_RATE:
        raise ValueError(
            f"PstLM needs at least {LEAST_SECONDS:.1f} s sampled at {LEAST_RATE:g} Hz or more, not "
            f"{seconds:g} s at {rate:g} Hz"
        )
    visible = _filtered(_sections(rate), light / light.mean() - 1)
    slow = _corner(1 / (2 * np.pi * SMOOTHING), rate)
    smooth = _digital((slow, (1.0, slow)), rate)[None]
    sensation = _filtered(smooth, SCALE * visible**2)[round(SETTLING * rate) :]
    total = 0.0
    for weight, percents in LEVELS:
        total += weight * float(np.percentile(sensation, [100 - p for p in percents]).mean())
    return float(np.sqrt(max(total, 0.0)))
