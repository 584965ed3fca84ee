"""The supply's ripple in the frames: stripes.

A ripple of frequency f adds A sin(2 pi f t) at the instant t at which a pixel is read (document
004: ripple near the sensor's output frequency enters the output amplifier, and slanted stripes
cover the picture). Pixel c of row r is read r L + c cycles of the pixel clock after the frame's
first. So the stripes are a plane wave of

    f / f_clock cycles a column and f L / f_clock cycles a row,

of which sampling leaves the distance to the nearest whole number: a low frequency makes rows darker
and brighter, f L / f_clock = f t_row cycles a row; one near the clock, slanted stripes.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from imagers.common.fixed import FixedTiming

__all__ = ["Ripple", "strongest_stripes"]

Values = npt.NDArray[np.float64]


def _beside_whole(cycles: Fraction) -> float:
    """What sampling leaves of a frequency in cycles a sample, -1/2 to 1/2."""
    return float(cycles - round(cycles))


def _upright(row: float, column: float) -> tuple[float, float]:
    """Of a wave and its negative, the one whose larger part is positive."""
    return (-row, -column) if max(row, column, key=abs) < 0 else (row, column)


@dataclass(frozen=True)
class Ripple:
    """A sine on the supply.

    Attributes:
        volts: amplitude at the sensor's output.
        hertz: frequency.
        timing: of the readout.
    """

    volts: float
    hertz: float
    timing: FixedTiming

    @property
    def _per_cycle(self) -> Fraction:
        """Periods in a cycle of the pixel clock, exact."""
        clock = self.timing.clock
        return Fraction(repr(self.hertz)) * clock.den / clock.num

    @property
    def rms(self) -> float:
        """Volts RMS: of V_circuit, in quadrature."""
        return self.volts / 2**0.5

    def at(self, frame: int, first: int, rows: int, columns: int) -> Values:
        """Volts at the readout of these pixels, (rows, columns). Phases are reduced exactly, so a
        late frame is as accurate as the first."""
        per, timing = self._per_cycle, self.timing
        start = timing.first(frame) + first * timing.line
        turns = np.arange(rows)[:, None] * float(per * timing.line % 1) + float(per * start % 1)
        return self.volts * np.sin(2 * np.pi * (turns + np.arange(columns) * float(per % 1)))

    def stripes(self) -> tuple[float, float]:
        """Spatial frequency of the stripes, cycles a row and cycles a column, by the closed form;
        of the two signs that a real wave has, the one whose larger part is positive."""
        per = self._per_cycle
        return _upright(_beside_whole(per * self.timing.line), _beside_whole(per))


def strongest_stripes(values: npt.NDArray[np.uint16]) -> tuple[float, float, float]:
    """Spatial frequency (cycles a row, cycles a column) and amplitude (DN) of the strongest plane
    wave in a frame. The peak of the spectrum is refined by the phase between halves of the frame,
    to a small part of 1/rows and 1/columns."""
    rows, columns = values.shape
    plane = values - values.mean()
    power = np.abs(np.fft.rfft2(plane))
    peak_row, peak_column = np.unravel_index(int(power.argmax()), power.shape)
    row, column = peak_row / rows, peak_column / columns
    row -= round(row)
    down, across = np.arange(rows), np.arange(columns)
    for _ in range(4):
        wave = plane * np.exp(-2j * np.pi * (row * down[:, None] + column * across))
        row += _turned(wave.sum(axis=1)) / (rows / 2)
        column += _turned(wave.sum(axis=0)) / (columns / 2)
    # Least squares of cosine and sine: they are not orthogonal over a part of a period.
    angle = 2 * np.pi * (row * down[:, None] + column * across).ravel()
    parts = np.stack([np.cos(angle), np.sin(angle)])
    amplitude = np.hypot(*np.linalg.solve(parts @ parts.T, parts @ plane.ravel()))
    return (*_upright(float(row), float(column)), float(amplitude))


def _turned(samples: npt.NDArray[np.complex128]) -> float:
    """Turns by which the second half of a line leads the first."""
    half = len(samples) // 2
    ratio = samples[-half:].sum() * np.conj(samples[:half].sum())
    return float(np.angle(ratio)) / (2 * np.pi)
