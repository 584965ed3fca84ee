"""Bit rates of a transmission, in the time of the simulated machine."""

from __future__ import annotations

from dataclasses import dataclass

from cosim import Clock
from link.layout import Layout


@dataclass(frozen=True)
class Rates:
    """Bit rates, bit/s.

    Attributes:
        raw: one bit of every data cell in every symbol.
        coded: the rate after line code and the code of the words.
        goodput: the file's bits from first light to its last verified byte, None if it did not
            arrive.
    """

    raw: float
    coded: float
    goodput: float | None


def link_rates(
    layout: Layout, clock: Clock, file_bytes: int, seconds: float | None,
    word_rate: float | None = None,
) -> Rates:  # fmt: skip
    """Bit rates.

    Args:
        layout: layout of the cells.
        clock: clock of the panel.
        file_bytes: size of the file.
        seconds: time from first light to the last verified byte, s; None without one.
        word_rate: share of data in the words; None for that of the mode.
    """
    raw = layout.cells * clock.hz / layout.mode.ticks
    line = layout.mode.code.bits / layout.group
    coded = raw * line * (layout.mode.word_rate if word_rate is None else word_rate)
    return Rates(raw, coded, 8 * file_bytes / seconds if seconds else None)
