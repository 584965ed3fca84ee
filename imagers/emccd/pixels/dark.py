"""Dark current of an EMCCD in inverted mode, over temperature.

Qd = Qd0 * 1.14e6 T^3 exp(-9080 / T), E2V's data sheet of the CCD97 for inverted mode operation,
which the document's device uses ("inverted output suppresses dark current noise"). (E2V's other
form, 122 T^3 exp(-6400 / T), is for chips that are not inverted.)
"""

from __future__ import annotations

import math
from typing import Final

from imagers.emccd.pixels.chip import ZERO_CELSIUS

__all__ = ["DARK_AT_20C", "DSNU_SHARE", "dark_current"]

DARK_AT_20C: Final = 400.0
"""e- / (pixel s), typical; 800 at most (data sheet)."""
DSNU_SHARE: Final = 60.0 / 400.0
"""Standard deviation of pixels' dark currents over their mean: 60 of 400 e- / (pixel s) at 20 degC
(data sheet); taken as the same share at any temperature (assumed)."""

_FACTOR: Final = 1.14e6
_KELVIN: Final = 9080.0


def dark_current(kelvin: float, at_20c: float = DARK_AT_20C) -> float:
    """e- / (pixel s): 33.5, 8.5 and 1.93 at 0, -10 and -20 degC for the typical chip.

    The printed factor is rounded and gives 1.012 at 20 degC; here it is scaled to exactly 1.
    """
    if not kelvin > 0:
        raise ValueError(f"kelvin must be positive, not {kelvin:g}")
    return at_20c * _factor(kelvin) / _factor(ZERO_CELSIUS + 20.0)


def _factor(kelvin: float) -> float:
    return _FACTOR * kelvin**3 * math.exp(-_KELVIN / kelvin)
