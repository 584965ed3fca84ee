"""`CmosSetting`: parameters of a three-transistor pixel with an 8-bit converter.

The document is "CMOS image sensor with wide dynamic range and adaptive exposure" (2022, source
document 001). It prints the response of 1.0 V/(lx s), gain 1 and 8 bits; it prints no full scale.
1 V is assumed: then 1e6 lx, its brightest, is full scale at 1 us, its shortest exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

BOLTZMANN: Final = 1.380649e-23
"""J/K, exact by definition of the SI (2019)."""
ELEMENTARY_CHARGE: Final = 1.602176634e-19
"""C, exact by definition of the SI (2019)."""
BITS: Final = 8
"""Bits of the converter (document 001, section 1)."""
ROUNDING: Final = 1e-9
"""DN that the floats of the chain may be off."""


@dataclass(frozen=True)
class CmosSetting:
    """A pixel and its signal chain. Document 001 states responsivity and gain; the rest is assumed.

    Attributes:
        responsivity: S at the pixel, V/(lx s).
        gain: A, gain of the amplifier before the converter.
        full_scale: full scale of the converter, V.
        conversion: conversion gain, V/e.
        well: full well of the photodiode, e.
        celsius: temperature of the chip, degC.
        dark_rate: dark current at 25 degC, e/s (624 is 0.1 nA/cm2 on 10 um x 10 um).
        dark_doubling: temperature rise that doubles the dark current, K (6 to 7).
        read_noise: noise of source follower and converter, e RMS.
        dsnu: standard deviation of the dark current over its mean.
        prnu: standard deviation of the response over its mean.
        column: standard deviation of the column offset over full scale.
        device: seed of the fixed pattern.
    """

    responsivity: float = 1.0
    gain: float = 1.0
    full_scale: float = 1.0
    conversion: float = 20e-6
    well: float = 60_000.0
    celsius: float = 27.0
    dark_rate: float = 624.0
    dark_doubling: float = 6.5
    read_noise: float = 10.0
    dsnu: float = 0.2
    prnu: float = 0.01
    column: float = 0.002
    device: int = 1

    def __post_init__(self) -> None:
        for name in (
            "responsivity", "gain", "full_scale", "conversion", "well", "dark_doubling",
        ):  # fmt: skip
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {value:g}")
        for name in ("dark_rate", "read_noise", "dsnu", "prnu", "column"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ValueError(f"{name} must be finite and not negative, not {value:g}")
        if self.well * self.conversion * self.gain <= self.full_scale:
            held = self.well * self.conversion * self.gain
            raise ValueError(
                f"well x conversion x gain must exceed the converter's full scale, not {held:g} V "
                f"of {self.full_scale:g} V: saturation would never be seen"
            )

    @property
    def lsb(self) -> float:
        """Volts of one DN at the converter: full scale / 256, since the converter truncates."""
        return self.full_scale / (1 << BITS)

    @property
    def step(self) -> float:
        """Electrons of one DN at the pixel."""
        return self.lsb / (self.gain * self.conversion)

    @property
    def sensitivity(self) -> float:
        """Photoelectrons in a lux second: 50 000 at 1.0 V/(lx s) and 20 uV an electron."""
        return self.responsivity / self.conversion

    @property
    def kelvin(self) -> float:
        return self.celsius + 273.15

    @property
    def reset_noise(self) -> float:
        """sqrt(2 k T C)/q, electrons RMS, with C = q/conversion: the reset that is subtracted is
        the one after the read, so the noise of two resets remains."""
        capacitance = ELEMENTARY_CHARGE / self.conversion
        return math.sqrt(2 * BOLTZMANN * self.kelvin * capacitance) / ELEMENTARY_CHARGE

    @property
    def dark_now(self) -> float:
        """Dark current at the chip's temperature, e/s."""
        return self.dark_rate * 2.0 ** ((self.celsius - 25.0) / self.dark_doubling)

    def volts(self, lux: float, seconds: float) -> float:
        """V = A S E t (document 001, equation 1), at the converter, without noise and dark."""
        return self.gain * self.responsivity * lux * seconds

    def value(self, lux: float, seconds: float) -> tuple[int, bool]:
        """DN and whether it is saturated, without noise and dark."""
        return self.digitised(self.volts(lux, seconds))

    def digitised(self, volts: float) -> tuple[int, bool]:
        """Values as the converter gives them: truncated to 0..255, saturated where the comparator
        sees more than full scale. A number that differs from an integer only by rounding counts as
        that integer."""
        number = math.floor(min(volts / self.lsb, 1e6) + ROUNDING)
        return max(0, min(number, (1 << BITS) - 1)), volts > self.full_scale * (1 + ROUNDING)
