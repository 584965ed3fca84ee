"""The converter that turns a measured photocurrent into a code: linear, or mantissa and exponent.

A scene spans decades (Huang 2022 section 4.5: nine from night to noon), which a linear code pays
for with a bit an octave. With E exponent bits and M mantissa bits a code holds a whole number of
units n = m for exponent 0 and n = (2^M + m) 2^(e - 1) for e >= 1, as a floating-point number with
gradual underflow does: steps are even below 2^(M + 1) units and relative above, half a step at
most 2^-(M + 1) of the value. Without exponent bits the code is linear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
Codes = npt.NDArray[np.uint32]


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
