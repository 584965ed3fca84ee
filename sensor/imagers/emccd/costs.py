"""What effects of an EMCCD's pixels cost, ns a pixel-frame: measured once on one core at 2.5 GHz
with 12 electrons a pixel at gain 100. Overflow counts a picture that does overflow."""

from __future__ import annotations

from typing import Final

__all__ = ["COSTS"]

COSTS: Final = {
    "shot noise": 150.0,
    "PRNU": 70.0,
    "smear": 10.0,
    "dark current": 3.0,
    "dark shot noise": 50.0,
    "DSNU": 70.0,
    "image well overflow": 5.0,
    "clock-induced charge": 50.0,
    "multiplication noise": 300.0,
    "register overflow": 5.0,
    "read noise": 70.0,
}
