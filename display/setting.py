"""A display as it is simulated: the panel, who looks, and how finely time is resolved."""

from __future__ import annotations

from dataclasses import dataclass

from display.panel import SpikePanel
from display.views import Observer

__all__ = ["DisplaySetting"]


@dataclass(frozen=True)
class DisplaySetting:
    """panel: as it is in full. observer: through whom the error is told. batch: planes to a span
    of light, 1 to 64; row_timing: whether rows are shown at their own instants."""

    panel: SpikePanel
    observer: Observer
    batch: int = 1
    row_timing: bool = True
