"""The cycle model of the board: registers, pixels, capture, sink and uartbone, exact in every bit
and clock. Importing it loads numba."""

from rtl_model.cycle.array import TILE, Tiles
from rtl_model.cycle.bridge import Behind, Bridge
from rtl_model.cycle.planes import Settings, planes
from rtl_model.cycle.system import System

__all__ = [
    "TILE",
    "Behind",
    "Bridge",
    "Settings",
    "System",
    "Tiles",
    "planes",
]
