"""Drives of a spike-continuous panel, one file each, and their catalogue."""

from display.drives.causal import CAUSAL as _CAUSAL
from display.drives.drive import Drive
from display.drives.hold import HOLD as _HOLD
from display.drives.impulse import IMPULSE as _IMPULSE

__all__ = ["DRIVES", "Drive"]

DRIVES: dict[str, Drive] = {
    drive.name: drive
    for drive in (
        _IMPULSE,
        _HOLD,
        _CAUSAL,
    )
}
"""The drives by their names in a scenario. A new drive is a file and a line here."""
