"""The cycle model: the board's registers, pixels, capture, sink and uartbone, bit-true and to the
clock. It brings numba with it."""

from rtl_model.cycle.bridge import Behind, Bridge
from rtl_model.cycle.planes import Settings, planes
from rtl_model.cycle.system import System
from rtl_model.cycle.tiles import Tiles

__all__ = [
    "Behind",
    "Bridge",
    "Settings",
    "System",
    "Tiles",
    "planes",
]
