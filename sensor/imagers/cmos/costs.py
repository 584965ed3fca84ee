"""What effects of a three-transistor pixel cost, in nanoseconds a pixel of a frame.

Measured once, on one core at 2.5 GHz, as the difference that leaving the effect out makes to a
frame of 1024 x 1280 pixels at half scale and 10 ms. The planner's choice goes by this table on any
machine.
"""

from __future__ import annotations

from typing import Final

__all__ = ["COSTS"]

COSTS: Final[dict[str, float]] = {
    "shot noise": 145.0,
    "dark current": 7.0,
    "dark shot noise": 100.0,
    "reset noise": 95.0,
    "read noise": 95.0,
    "DSNU": 11.0,
    "PRNU": 7.0,
    "column pattern": 11.0,
}
