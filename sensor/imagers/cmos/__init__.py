"""Three-transistor CMOS pixels with an 8-bit converter: the adaptive-exposure sensor's array."""

from sensor.imagers.cmos.pixels import AdaptivePixels, CmosExposed
from sensor.imagers.cmos.setting import BITS, CmosSetting

__all__ = [
    "BITS",
    "AdaptivePixels",
    "CmosExposed",
    "CmosSetting",
]
