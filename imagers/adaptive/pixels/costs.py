"""Run-time costs of the effects of a three-transistor pixel, ns per pixel and frame.

Each is the difference of run time with and without the effect, measured once on one core at 2.5 GHz
for a frame of 1024 x 1280 pixels at half scale and 10 ms. The planner uses this table on every
machine, so a plan does not depend on the machine.
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
