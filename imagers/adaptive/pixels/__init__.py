"""Three-transistor CMOS pixels with an 8-bit converter: the adaptive-exposure sensor's array."""

from imagers.adaptive.pixels.array import AdaptivePixels, CmosExposed
from imagers.adaptive.pixels.setting import BITS, CmosSetting

__all__ = [
    "BITS",
    "AdaptivePixels",
    "CmosExposed",
    "CmosSetting",
]
