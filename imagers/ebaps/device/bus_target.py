"""The EBAPS board behind a serial line: its sequencer in steady light, without pixels.

The light gives the middle of the loop's window at an exposure of 20 ms, without dark level, so that
the loop can be observed through its registers.
"""

from __future__ import annotations

from imagers.ebaps.device.exposure import WINDOW
from imagers.ebaps.device.sequencer import Read, Sequencer, Shot

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
