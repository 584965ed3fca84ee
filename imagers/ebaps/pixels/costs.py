"""Run-time costs of the effects of an EBAPS, ns per pixel and frame, measured once for 1280 x 1024
on one core at 2.5 GHz. The planner needs only their order of magnitude."""

from __future__ import annotations

from typing import Final

__all__ = ["COSTS"]

COSTS: Final[dict[str, float]] = {
    "shot noise": 105.0,
    "photocathode emission": 2.0,
    "electron loss": 10.0,
    "gain spread": 100.0,
    "landing spread": 5.0,
    "halo": 30.0,
    "ion events": 90.0,
    "direct light": 4.0,
    "dark current": 2.0,
    "silicon shot noise": 175.0,
    "DSNU": 4.0,
    "offset FPN": 2.0,
    "PRNU": 2.0,
    "stripes": 2.0,
    "read noise": 100.0,
}
