"""The setting of a continuous-photographing sensor, with the converter that turns a measured
photocurrent into a code: linear, or mantissa and exponent.

A scene spans decades (Huang 2022 section 4.5: nine from night to noon), which a linear code pays
for with a bit an octave. With E exponent bits and M mantissa bits a code holds a whole number of
units n = m for exponent 0 and n = (2^M + m) 2^(e - 1) for e >= 1, as a floating-point number with
gradual underflow does: steps are even below 2^(M + 1) units and relative above, half a step at
most 2^-(M + 1) of the value. Without exponent bits the code is linear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.radiometry import photons_per_lux
from sensor.device.chips import Chip
from sensor.device.pattern import DevicePattern

Values = npt.NDArray[np.float64]
Codes = npt.NDArray[np.uint32]
QUIET = 6.0
"""Standard deviations of shot noise that the threshold holds at least where no floor is given. A
change is measured from a reference that is as noisy as the current itself, so their difference has
sqrt(2) times its deviation."""


@dataclass(frozen=True)
class ContinuousSetting:
    """Everything that decides the reports but the light. Raises ValueError for a number out of
    range.

    Attributes:
        chip: preset. Its size, pitch and quantum efficiency are used; its clocks and thresholds
            belong to its spike readout.
        clock: clock of the time stamps; with noise the monitor also samples once a tick.
        seed: seed of the run, below 2^32.
        time_constant: time constant of the monitor's one-pole filter, s.
        contrast: change that is reported, relative to the last report.
        floor: the same in electrons/s; the larger of both counts.
        converter: converter of the reported value.
        measure: time over which the photocurrent is averaged after a change, s; 0 reads the
            monitor's current.
        dead_time: time after a report in which the monitor is inactive, s.
        noise: whether there is shot noise.
        wavelength_nm: wavelength at which lux are counted as photons.
        pattern: fixed pattern of the device, None for a perfect one.
    """

    chip: Chip
    clock: Clock
    seed: int
    time_constant: float
    contrast: float
    floor: float
    converter: Converter
    measure: float = 0.0
    dead_time: float = 0.0
    noise: bool = True
    wavelength_nm: float = 555.0
    pattern: DevicePattern | None = None

    def __post_init__(self) -> None:
        for name, above in (("time_constant", 0.0), ("floor", 0.0)):
            if not above < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be above {above:g}, not {getattr(self, name):g}")
        for name in ("contrast", "measure", "dead_time"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be 0 or more, not {getattr(self, name):g}")
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"seed must be from 0 to below 2^32, not {self.seed}")
        if self.pattern is not None and self.pattern.threshold_fpn > 0:
            raise ValueError(
                "threshold_fpn must be 0, since no charge threshold is there to vary, not "
                f"{self.pattern.threshold_fpn:g}"
            )

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons a second for a lux on the pixel."""
        return self.chip.electrons_per_lux(photons_per_lux(self.wavelength_nm))

    def threshold(self, current: float) -> float:
        """Change (electrons/s) that is reported after a report of `current`."""
        return max(self.contrast * current, self.floor)

    def shot_noise(self, current: float) -> float:
        """Standard deviation of the monitor's current, electrons/s: Campbell's theorem."""
        return math.sqrt(current / (2 * self.time_constant))

    def ticks(self, seconds: float) -> int:
        """Whole ticks that hold `seconds`."""
        return math.ceil(seconds * self.clock.hz * (1 - 1e-12))

    @property
    def report_bits(self) -> int:
        """Bits of one report on a shared channel: row, column and code (its time is when it is
        sent)."""
        rows, columns = (max(n - 1, 1).bit_length() for n in (self.chip.height, self.chip.width))
        return rows + columns + self.converter.bits


def quiet_floor(contrast: float, time_constant: float, sigmas: float = QUIET) -> float:
    """The least absolute threshold (electrons/s) that, with a relative one of `contrast`, is
    `sigmas` standard deviations of shot noise or more at any light.

    The deviation is sqrt(i / 2 tau); contrast x i is n of them from i = n^2 / (2 tau contrast^2)
    up, and what it is there, n^2 / (2 tau contrast), is enough for all that is darker.
    """
    return sigmas**2 / (2 * time_constant * contrast)


@dataclass(frozen=True)
class Converter:
    """A floating-point converter of photocurrents.

    Attributes:
        bits: bits of a code, 1 to 24.
        exponent_bits: bits of the exponent in a code, 0 to 6 and fewer than bits.
        full_scale: the largest value, electrons a second; what is above is held at it.
    """

    bits: int
    exponent_bits: int
    full_scale: float

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 24:
            raise ValueError(f"bits must be 1 to 24, not {self.bits}")
        if not 0 <= self.exponent_bits <= min(6, self.bits - 1):
            raise ValueError(
                f"exponent bits must be 0 to 6 and fewer than {self.bits}, not {self.exponent_bits}"
            )
        if not 0 < self.full_scale < np.inf:
            raise ValueError(f"full scale must be above 0, not {self.full_scale:g}")

    @property
    def mantissa_bits(self) -> int:
        return self.bits - self.exponent_bits

    @property
    def unit(self) -> float:
        """Electrons a second of the smallest step."""
        return self.full_scale / float(self._units(np.array([(1 << self.bits) - 1], np.uint32))[0])

    def _units(self, codes: Codes) -> Values:
        mantissa = (codes & np.uint32((1 << self.mantissa_bits) - 1)).astype(np.float64)
        exponent = (codes >> np.uint32(self.mantissa_bits)).astype(np.int64)
        hidden = np.where(exponent > 0, 2.0**self.mantissa_bits, 0.0)
        return np.ldexp(mantissa + hidden, np.maximum(exponent - 1, 0))

    def encode(self, values: Values) -> Codes:
        """The nearest code; negative values give 0, those above full scale the largest."""
        units = np.clip(values, 0, self.full_scale) / self.unit
        # frexp gives a fraction from 1/2: numbers from 2^M to 2^(M + 1) have exponent M + 1.
        step = np.maximum(np.frexp(units)[1] - (self.mantissa_bits + 1), 0)
        if not self.exponent_bits:
            step = np.zeros_like(step)
        mantissa = np.rint(np.ldexp(units, -step)).astype(np.int64)
        # 2^(M + 1) after rounding is the next exponent's first: the sum carries by itself.
        codes = mantissa + (step << self.mantissa_bits)
        return np.minimum(codes, (1 << self.bits) - 1).astype(np.uint32)

    def decode(self, codes: Codes) -> Values:
        """Electrons a second that a code stands for."""
        return self._units(codes) * self.unit
