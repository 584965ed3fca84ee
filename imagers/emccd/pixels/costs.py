"""Costs of the effects of an EMCCD's pixels, ns per pixel and frame.

Each was measured once by leaving the effect out of a whole frame with 12 electrons per pixel at a
gain of 100, on one core at 2.5 GHz, where all effects together take 0.25 s a frame. The fixed
pattern is drawn once and then only applied; overflow is evaluated for each pixel, whether or not it
spills.
"""

from __future__ import annotations

from typing import Final

__all__ = ["COSTS"]

COSTS: Final = {
    "shot noise": 130.0,
    "PRNU": 5.0,
    "smear": 10.0,
    "dark current": 5.0,
    "dark shot noise": 65.0,
    "DSNU": 5.0,
    "image well overflow": 4.0,
    "clock-induced charge": 65.0,
    "multiplication noise": 330.0,
    "register overflow": 4.0,
    "read noise": 85.0,
}
