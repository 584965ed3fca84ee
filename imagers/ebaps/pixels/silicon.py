"""The silicon half of an EBAPS: dark current, analog chain, converter, fixed pattern.

The document does not print these figures of the chip. All are assumed, with values typical of such
pixels. The analog gain was chosen so that the exposure loop reaches its target where the document
shows an image: with a lens f/1.4 (T = 0.9), a chart of mean reflectance 0.5 under 3e-3 lx at -1500
V gives 7.8 photoelectrons per pixel in 32.768 ms, or 1.6e3 electrons in the silicon. At 20 DN per
electron this is 3.1e4 DN, so 24 800 DN are reached at 26 ms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import gamma
from cosim.compute.streams import Stream
from imagers.common.frame_pixel import FixedPattern

Values = npt.NDArray[np.float64]
_DARK, _OFFSET, _RESPONSE, _COLUMNS, _ROWS, _STRIPES = range(6)
"""Kinds of fixed pattern: the `frame` of their draws."""


@dataclass(frozen=True)
class Silicon:
    """The CMOS sensor behind the tube. All values are assumed (see the module).

    Stripes of the response remain after subtraction of dark frames: the document reports horizontal
    stripes after the subtraction.

    Attributes:
        pitch: pixel pitch, m.
        direct: response of back-thinned silicon to light of 2856 K, electrons / (s m2 lx).
        leakage: share of the light that passes the photocathode and reaches the silicon.
        dark: dark current at `dark_kelvin`, electrons/s.
        dark_kelvin: temperature of `dark`, K.
        doubling: temperature rise that doubles the dark current, K.
        read_noise: read noise, electrons RMS.
        dn_per_electron: analog gain, DN per electron.
        black: black level, DN: six standard deviations of read noise and offsets.
        well: full well, electrons.
        dsnu: standard deviation of the dark current over its mean (gamma distributed).
        offset: standard deviation of the offset of a pixel, electrons.
        column_offset: standard deviation of the offset of a column, electrons.
        row_offset: standard deviation of the offset of a row, electrons.
        prnu: standard deviation of the response of a pixel over its mean.
        stripes: standard deviation of the response of a row over its mean.
    """

    pitch: float = 10.8e-6
    direct: float = 3.3e16
    leakage: float = 1e-4
    dark: float = 2000.0
    dark_kelvin: float = 300.0
    doubling: float = 6.5
    read_noise: float = 30.0
    dn_per_electron: float = 20.0
    black: float = 4000.0
    well: float = 30_000.0
    dsnu: float = 0.3
    offset: float = 8.0
    column_offset: float = 5.0
    row_offset: float = 3.0
    prnu: float = 0.02
    stripes: float = 0.015

    def __post_init__(self) -> None:
        sizes = (self.pitch, self.dark_kelvin, self.doubling, self.dn_per_electron, self.well)
        if not all(0 < size < math.inf for size in sizes):
            raise ValueError("pitch, temperatures, gain and well must be above 0")
        rest = (
            self.direct, self.leakage, self.dark, self.read_noise, self.black, self.dsnu,
            self.offset, self.column_offset, self.row_offset, self.prnu, self.stripes,
        )  # fmt: skip
        if not all(0 <= each < math.inf for each in rest):
            raise ValueError("noise, dark current and pattern must not be negative")

    @property
    def area(self) -> float:
        """Area of a pixel, m2; all of it is sensitive."""
        return self.pitch**2

    def dark_rate(self, kelvin: float) -> float:
        """Electrons a second: I0 2^((T - T0)/T_d)."""
        return float(self.dark * 2 ** ((kelvin - self.dark_kelvin) / self.doubling))

    @property
    def offset_spread(self) -> float:
        """Standard deviation of all offsets together, electrons."""
        return math.hypot(self.offset, self.column_offset, self.row_offset)


class Pattern:
    """The fixed pattern of one device. shape: (H, W). seed: seed of the device."""

    def __init__(self, silicon: Silicon, shape: tuple[int, int], seed: int) -> None:
        self.silicon, self.shape = silicon, shape
        self._drawn = FixedPattern(shape, seed)

    def dark(self) -> Values:
        """(H, W) factor of the dark current: gamma of mean 1 and deviation dsnu."""
        drawn, dsnu = self._drawn, self.silicon.dsnu
        if not dsnu:
            return np.ones(self.shape)
        k, stream = dsnu**-2, Stream.IMAGER_PATTERN
        return drawn.once("dark", lambda: gamma(k, drawn.numbers(), _DARK, drawn.seed, stream) / k)

    def offset(self) -> Values:
        """(H, W) electrons: of pixels, columns and rows."""
        drawn, s, (height, width) = self._drawn, self.silicon, self.shape
        return drawn.once(
            "offset",
            lambda: (
                s.offset * drawn.normal(_OFFSET)
                + s.column_offset * drawn.normal(_COLUMNS, (1, width))
                + s.row_offset * drawn.normal(_ROWS, (height, 1))
            ),
        )

    def response(self) -> Values:
        """(H, W) factor of pixels, never negative; mean 1."""
        return self._drawn.factor(_RESPONSE, self.silicon.prnu)

    def stripes(self) -> Values:
        """(H, 1) factor of rows, never negative; mean 1."""
        return self._drawn.factor(_STRIPES, self.silicon.stripes, (self.shape[0], 1))
