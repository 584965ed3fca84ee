"""Reset noise of a capacitance, and the constants that turn it into electrons."""

from __future__ import annotations

import math
from typing import Final

BOLTZMANN: Final = 1.380649e-23
"""J/K, exact by definition of the SI (2019)."""
ELEMENTARY_CHARGE: Final = 1.602176634e-19
"""C, exact by definition of the SI (2019)."""


def ktc_electrons(farad: float, kelvin: float = 300.0) -> float:
    """Reset noise of a capacitance in electrons: sqrt(k T C) / q."""
    return math.sqrt(BOLTZMANN * kelvin * farad) / ELEMENTARY_CHARGE
