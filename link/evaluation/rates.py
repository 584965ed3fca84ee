"""How fast a transmission was, in the time of the simulated machine."""

from __future__ import annotations

from dataclasses import dataclass

from cosim import Clock
from link.layout import Layout

__all__ = ["Rates", "link_rates"]


@dataclass(frozen=True)
class Rates:
    """Bits a second. raw: a bit of every data cell in every symbol. coded: what line code and
    Reed-Solomon leave of it. goodput: the file's bits from first light to its last verified byte,
    None where it did not arrive."""

    raw: float
    coded: float
    goodput: float | None


def link_rates(layout: Layout, clock: Clock, file_bytes: int, seconds: float | None) -> Rates:
    """clock: the panel's. seconds: from first light to the last verified byte, None without one."""
    raw = layout.cells * clock.hz / layout.mode.ticks
    line = layout.mode.code.bits / layout.group
    coded = raw * line * (255 - layout.mode.parity) / 255
    return Rates(raw, coded, 8 * file_bytes / seconds if seconds else None)
