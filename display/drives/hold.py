"""Hold: the light follows the last interval until the next spike. x = 1 / tau."""

from __future__ import annotations

from typing import Any

from display.drives.drive import Drive
from display.drives.intervals import interval_fluctuation, interval_variation

__all__ = ["HOLD"]


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return 1.0 / tau


HOLD = Drive("hold", 2, _level, "held", interval_fluctuation, interval_variation)
