"""The EBAPS board behind a serial line, by itself: its sequencer under steady light, no pixels.

Light: what the window's middle asks an exposure of 20 ms for, with no dark level; so the loop can
be watched over its registers.
"""

from __future__ import annotations

from rtl_model.imagers.ebaps.device.exposure import WINDOW
from rtl_model.imagers.ebaps.device.sequencer import Read, Sequencer, Shot

__all__ = ["bus_target"]

_WANTED = 20_000_000
"""ns."""


def _steady(shot: Shot) -> Read:
    middle = sum(WINDOW) // 2
    total = 0 if shot.closed or not shot.volts else min(middle * shot.exposure // _WANTED, 65_535)
    return Read(total, total, 1)


def bus_target() -> Sequencer:
    """A `BusTarget`."""
    return Sequencer(_steady)
