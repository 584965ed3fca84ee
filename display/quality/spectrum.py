"""The spectrum of a light waveform as components, with the leakage of each line added to it.

The window is a Hann window. Bins between two local minima of the spectrum form a group. By
Parseval's theorem, the energy of a group is that of its line, for any frequency between two bins
(the main lobe of a Hann window has all but 0.05 % of it). Longer waveforms are cut into pieces of
about one second, and their power spectra are averaged, so that noise, which has no lines, is
reported per about one hertz for any length of the waveform. Lines less than about 4 Hz apart form
one component.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

Values = npt.NDArray[np.float64]
WINDOW: Final = 1.0
"""Length of a piece of a long waveform, s."""
STEADY: Final = 1e-12
"""Contrast below which a bin counts as rounding error."""
LEAST: Final = 16
"""Minimum number of samples of a waveform."""


def waveform(wave: npt.ArrayLike) -> Values:
    """The samples of light as (n,) float64. Raises ValueError unless there are at least LEAST
    samples, all finite and not negative, and not all zero."""
    light = np.asarray(wave, np.float64)
    if light.ndim != 1 or len(light) < LEAST:
        raise ValueError(f"a waveform must be {LEAST} or more samples, not {light.shape}")
    if not np.isfinite(light).all() or light.min() < 0 or light.max() == 0:
        raise ValueError("a waveform must be light: finite, never negative, not always 0")
    return light


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Contrast energy of a waveform over frequency.

    Attributes:
        frequency: frequency of each bin, Hz, (bins,).
        energy: energy of each bin as squared contrast, (bins,): a sine of contrast c (amplitude
            over mean) has c² over its bins.
        group: number of the component of each bin, (bins,).
    """

    frequency: Values
    energy: Values
    group: npt.NDArray[np.int64]

    def components(self, gain: npt.ArrayLike = 1.0) -> tuple[Values, Values]:
        """The frequency of the strongest bin, Hz, and the contrast of each component. `gain`:
        factor on the contrast of each bin, (bins,)."""
        gains = np.broadcast_to(np.asarray(gain, np.float64), self.energy.shape)
        total, strongest = _components(self.energy, gains, self.group)
        return self.frequency[strongest], np.sqrt(total)


@njit(cache=True, nogil=True)
def _components(energy, gain, group):  # type: ignore[no-untyped-def]
    """The energy of each component, (components,), and its strongest bin, the first of equal
    ones."""
    total = np.zeros(group[-1] + 1)
    strongest = np.zeros(len(total), np.int64)
    last = -1
    for k in range(len(energy)):
        at = group[k]
        total[at] += energy[k] * gain[k] ** 2
        if at != last or energy[k] > energy[strongest[at]]:
            strongest[at] = k
        last = at
    return total, strongest


@lru_cache(maxsize=4)
def _hann(length: int) -> Values:
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    window.flags.writeable = False
    return window


def spectrum(wave: npt.ArrayLike, rate: float) -> Spectrum:
    """The spectrum of light sampled at `rate`, Hz, relative to its mean. Raises ValueError."""
    if not rate > 0:
        raise ValueError(f"sampling rate must be positive, not {rate:g} Hz")
    light = waveform(wave)
    pieces = max(int(len(light) / (rate * WINDOW) + 1e-9), 1)
    length = len(light) // pieces
    parts = light[: pieces * length].reshape(pieces, length)
    window = _hann(length)
    # The mean under the window is subtracted, because it would leak into the lowest bins.
    level = (parts * window).sum(axis=1) / window.sum()
    power = np.abs(np.fft.rfft((parts - level[:, None]) * window)) ** 2
    scale = 4 / (length * (window**2).sum()) / light.mean() ** 2
    energy = power.mean(axis=0) * scale
    energy[energy < STEADY**2] = 0.0
    energy[0] = 0.0
    lows = np.flatnonzero((energy[1:-1] < energy[:-2]) & (energy[1:-1] <= energy[2:])) + 1
    group = np.zeros(len(energy), np.int64)
    group[lows] = 1
    frequency = np.arange(len(energy), dtype=np.float64) * (rate / length)
    return Spectrum(frequency, energy, np.cumsum(group))
