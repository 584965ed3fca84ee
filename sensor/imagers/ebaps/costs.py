"""What the effects of an EBAPS cost, ns a pixel and frame: measured once, 1280 x 1024, one core of
2.5 GHz; only their order and size matter."""

from __future__ import annotations

from typing import Final

__all__ = ["BASE", "COSTS"]

BASE: Final = 30.0
"""A frame with every effect left out."""
COSTS: Final[dict[str, float]] = {
    "shot noise": 60.0,
    "photocathode emission": 2.0,
    "electron loss": 5.0,
    "gain spread": 45.0,
    "landing spread": 12.0,
    "halo": 60.0,
    "ion events": 35.0,
    "direct light": 2.0,
    "dark current": 3.0,
    "silicon shot noise": 90.0,
    "DSNU": 2.0,
    "offset FPN": 2.0,
    "PRNU": 2.0,
    "stripes": 2.0,
    "read noise": 40.0,
}
