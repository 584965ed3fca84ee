"""Soft values of single cells for the explorer in a page, with what was sent and when."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.report.explorer import packed
from link.evaluation.record import LinkEvaluation
from link.layout import TRAINING

_TOP: Final = 127
"""Largest level of a soft value."""


def levels_of(soft: npt.NDArray[np.floating[Any]], top: float) -> npt.NDArray[np.int8]:
    """Soft values as levels: sign and 127 sqrt(abs(soft) / top), never 0, so that what was decided
    stays the same (a soft value of 0 is decided as off). The root resolves those near a wrong
    decision."""
    size = np.rint(_TOP * np.sqrt(np.clip(np.abs(soft.astype(np.float64)) / top, 0, 1)))
    return np.asarray(np.where(soft > 0, 1, -1) * np.maximum(size, 1), np.int8)


def soft_values(link: LinkEvaluation) -> dict[str, Any] | None:
    """What the explorer shows of single cells; None if no symbol of the file was read.

    In it: `cells` (n,) int32 indices of cells on the panel, ascending; `symbols` (m,) int32; `soft`
    (n, m) int8, from `levels_of`; `sent` bits of symbols `symbols[0]` - 1 to `symbols[-1]` + 1, (n,
    their number), packed; `start` (n,) float32, tick at which symbol 0 begins there; `period`,
    ticks.
    """
    received, sent = link.received, link.setup.sent
    watched, timing, where = received.watched, received.timing, received.registration
    if watched is None or timing is None or where is None or received.mode != link.mode:
        return None
    of_data = (watched.symbols >= TRAINING) & (watched.symbols < sent.data_end)
    symbols, soft = watched.symbols[of_data], watched.soft[of_data].T
    if not symbols.size:
        return None
    top = max(float(np.abs(soft).max()), 1e-6)
    layout, side = sent.layout, link.mode.cell
    places = layout.data[watched.cells]
    row, column = np.divmod(places, layout.shape[1])
    _, v = where.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)
    first, stop = int(symbols[0]) - 1, int(symbols[-1]) + 2
    bits = np.stack([sent.bits(n, 1)[0, watched.cells] for n in range(first, stop)], axis=1)
    return {
        "cells": packed(places.astype(np.int32)), "symbols": packed(symbols.astype(np.int32)),
        "soft": packed(levels_of(soft, top)), "sent": packed(np.packbits(bits, axis=1)),
        "start": packed(timing.start(0, v).astype(np.float32)), "period": timing.period,
        "top": top,
    }  # fmt: skip
