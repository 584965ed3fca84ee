"""Hot, dead and stuck pixels, pixels beyond the pattern's tails, and shading of the light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.bool_]
FAR: Final = 6.0
"""Robust standard deviations beyond which a pixel is not of the pattern: of a million normal ones,
0.002 are."""
_ROBUST: Final = 1.4826
"""Standard deviation of a normal law over its median absolute deviation."""
_STUCK: Final = 0.999
"""Spikes a cycle from which a pixel is stuck: it fires in every cycle."""
_DEAD: Final = 0.5
"""Gain of light, relative to the median, below which a pixel is dead."""


@dataclass(frozen=True, eq=False)
class Defects:
    """Pixels that differ, (n,) bool each.

    Attributes:
        hot: dark rate more than `FAR` spreads above the median; None without a dark recording.
        dead: half the gain of light or less; None without a flat.
        stuck: fires in every cycle, also in the dimmest recording.
        odd: otherwise beyond `FAR` spreads in some flat.
    """

    hot: Pixels | None
    dead: Pixels | None
    stuck: Pixels
    odd: Pixels

    @property
    def good(self) -> Pixels:
        """Pixels of the pattern."""
        out = ~(self.stuck | self.odd)
        for bad in (self.hot, self.dead):
            if bad is not None:
                out &= ~bad
        return out


def dark_rates(dark: Trains) -> Values:
    """Spikes a cycle of each pixel: by intervals, or by spikes over cycles if there is none."""
    rates = dark.spikes / dark.cycles
    return np.asarray(np.where(dark.spikes > 1, 1 / dark.intervals, rates))


def find_defects(flats: Sequence[Trains], dark: Trains | None) -> Defects:
    """Defects from recordings of uniform light and of darkness; there is at least one of them."""
    recordings = sorted([*flats, *([dark] if dark else [])], key=lambda each: each.rate)
    dimmest = recordings[0]
    stuck = dimmest.spikes >= _STUCK * dimmest.cycles
    if dimmest.rate >= _STUCK:
        stuck = np.zeros_like(stuck)
    none = np.zeros(stuck.shape)
    hot, in_dark = None, none
    if dark is not None:
        in_dark = dark_rates(dark)
        middle = float(np.median(in_dark))
        spread = max(_ROBUST * float(np.median(np.abs(in_dark - middle))), 0.5 / dark.cycles)
        hot = (in_dark > middle + FAR * spread) & (dark.spikes > 1) & ~stuck
    dead, odd = None, np.zeros_like(stuck)
    for flat in sorted(flats, key=lambda each: -each.rate):
        x = flat.spikes / flat.cycles - in_dark
        middle = float(np.median(x))
        if dead is None:
            dead = (x < _DEAD * middle) & ~stuck
        spread = _ROBUST * float(np.median(np.abs(x - middle)))
        odd |= np.abs(x - middle) > FAR * max(spread, 1.5 / flat.cycles)
    for known in (hot, dead, stuck):
        if known is not None:
            odd &= ~known
    return Defects(hot, dead, stuck, odd)


def shading(flats: Sequence[Trains], good: Pixels) -> Values:
    """Smooth shading of the light, (n,), relative, of mean 0: the quadratic surface that fits the
    rates of the good pixels over all flats. Uniform light has none; a lens or a sphere has some,
    which is not the camera's."""
    height, width = flats[0].shape
    y, x = (np.ravel(a) for a in np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j])
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    gain = np.mean([f.spikes / f.spikes[good].mean() for f in flats], axis=0)
    fitted, *_ = np.linalg.lstsq(terms[good], gain[good], rcond=None)
    surface = terms @ fitted
    return np.asarray(surface / surface[good].mean() - 1)
