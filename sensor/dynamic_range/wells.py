"""Response of a sensor above its linear range.

A sensor's data may give two saturation voltages, the linear full well and the full well: 2500 mV
and 3400 mV for the DALSA sensor of Wang et al. Between the two the output still rises
with light, but ever less. The document leaves this part out of the dynamic range, and so does this
package. This module computes what the part would add. The document does not print the curve: an
exponential approach with a continuous slope is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.dynamic_range.decibels import decibels

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FullWell:
    """Where a sensor's output leaves its linear range.

    Attributes:
        linear: volts up to which output goes with light.
        full: volts that it never exceeds.
    """

    linear: float
    full: float

    def response(self, light: npt.ArrayLike) -> Values:
        """Volts out of light, given as the volts that a sensor without an end would put out."""
        x = np.asarray(light, np.float64)
        room = self.full - self.linear
        beyond = np.maximum(x - self.linear, 0)
        bent = self.linear - room * np.expm1(-beyond / room) if room > 0 else self.linear
        return np.where(x <= self.linear, x, bent)

    @property
    def output_gain(self) -> float:
        """dB of output between the two."""
        return decibels(self.full / self.linear)


DALSA: Final = FullWell(2.5, 3.4)
"""Wang et al., patent of 2017."""
