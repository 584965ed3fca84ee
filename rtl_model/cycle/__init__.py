"""The cycle model: the board's registers, pixels, capture, sink and uartbone, bit-true and to the
clock. It brings numba with it."""

from rtl_model.cycle.bridge import Behind, Bridge, Reply
from rtl_model.cycle.capture import record
from rtl_model.cycle.pixel import CHARGE_MAX, Pattern, ResetRule, increments, step
from rtl_model.cycle.plain import PlainSensor
from rtl_model.cycle.planes import Settings, planes
from rtl_model.cycle.system import System
from rtl_model.cycle.tiles import TILE, Tiles, rows_of

__all__ = [
    "CHARGE_MAX",
    "TILE",
    "Behind",
    "Bridge",
    "Pattern",
    "PlainSensor",
    "Reply",
    "ResetRule",
    "Settings",
    "System",
    "Tiles",
    "increments",
    "planes",
    "record",
    "rows_of",
    "step",
]
