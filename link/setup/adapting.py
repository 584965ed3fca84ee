"""The rates of blocks that have one each, from the phase that each of them will meet.

Clocks that are apart by a constant ratio let the phase of the symbols drift evenly. Pilots give the
information of a bit at phases along that drift, and so that of each block. Its rate is the one with
which most of its frames are predicted to arrive. The numbers are those that a receiver has after
the training: the phase, and the ratio of the clocks. They reach the sender once, over a return
path; blocks tell their rates themselves (`link.coding.adaptive_blocks`), so that the receiver need
not know what the sender chose.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from link.coding import AdaptiveBlocks, blocks_of
from link.coding.fountain import source_symbols
from link.layout import TRAINING, Layout
from link.mode import EVERY_RATE, Mode
from link.theory import ldpc_word_error

_OFF: Final = 0.03
"""Ticks by which the phase may be another than foreseen: errors of a receiver's timing in runs."""
_SURE: Final = 4.75
"""Standard deviations of the frames lost that are allowed for: one file in a million lacks some."""
_LOST: Final = 0.01
"""Largest share of a block's frames that a rate may lose, where there is such a rate."""
_BEYOND: Final = 2
"""Frames beyond the file's own, as in the sender."""


@dataclass(frozen=True)
class Course:
    """The information of a bit along the drift of the phase.

    Attributes:
        delays: ticks by which the planes come later than at the begin, ascending or descending; a
            whole turn if the phase drifts further.
        information: information at each phase of the course.
        drift: change of the delay, ticks a tick.
    """

    delays: tuple[float, ...]
    information: tuple[float, ...]
    drift: float

    def least(self, begin: float, end: float) -> float:
        """Least information between two ticks of the transmission."""
        at = np.array([begin, end]) * self.drift
        delay = np.linspace(at.min() - _OFF, at.max() + _OFF, 9)
        turn = abs(self.delays[-1] - self.delays[0]) >= 1
        order = np.argsort(self.delays)
        known, value = np.array(self.delays)[order], np.array(self.information)[order]
        return float(np.interp(delay, known, value, period=1 if turn else None).min())


@dataclass(frozen=True)
class Plan:
    """Rates of blocks, and what they are predicted to do.

    Attributes:
        rates: numbers of the rates in `link.mode.EVERY_RATE`, from the first block on.
        words, frames: shares of words and of frames lost.
        overhead: frames beyond the file's own, as a share of them; infinite if no overhead that is
            allowed is enough.
        goodput: bit/s, 0 then.
    """

    rates: tuple[int, ...]
    words: float
    frames: float
    overhead: float
    goodput: float


def plan_rates(
    mode: Mode, course: Course, assumed: Callable[[float], float], size: int, hz: float,
    most_overhead: float = 1.0,
) -> Plan:  # fmt: skip
    """Rates of the blocks of a file.

    Args:
        mode: mode with a rate for each block.
        course: information along the drift.
        assumed: information that is counted on, of a measured one.
        size: size of the file, bytes.
        hz: planes per second.
        most_overhead: largest overhead.
    """
    try:
        form = blocks_of(Layout(mode))
    except ValueError:
        return Plan((), 1.0, 1.0, math.inf, 0.0)
    assert isinstance(form, AdaptiveBlocks)
    forms = [form.at(n) for n in range(len(EVERY_RATE))]
    each, length = form.frame_words, form.groups * form.layout.group * mode.ticks
    source = source_symbols(size, form.symbol_bytes)
    wanted = max(math.ceil(source * (1 + most_overhead)), source + _BEYOND)
    rates: list[int] = []
    sent = [0.0]
    lost, variance, words, whole = 0.0, 0.0, 0.0, None
    while sent[-1] < wanted or whole is None:
        begin = TRAINING * mode.ticks + len(rates) * length
        information = assumed(course.least(begin, begin + length))
        wrong = np.array([ldpc_word_error(rate, information) for rate in EVERY_RATE])
        fails = -np.expm1(each * np.log1p(-np.minimum(wrong, 1 - 1e-12)))
        count = np.array([one.frames for one in forms])
        held = fails <= max(_LOST, float(fails.min()))
        best = int(np.argmax(held * count * (1 - fails)))
        rates.append(best)
        sent.append(sent[-1] + count[best])
        lost += count[best] * fails[best]
        variance += count[best] * fails[best] * (1 - fails[best])
        words += forms[best].words * wrong[best]
        missing = lost + _SURE * math.sqrt(variance)
        if whole is None and sent[-1] - missing >= source + _BEYOND:
            whole = len(rates), (_BEYOND + missing) / source
        if whole is None and sent[-1] > 2 * wanted + count[best]:
            return Plan(tuple(rates), words / (each * sent[-1]), lost / sent[-1], math.inf, 0.0)
    blocks, overhead = whole
    shares = words / (each * sent[-1]), lost / sent[-1]
    if overhead > max(most_overhead, _BEYOND / source):
        return Plan(tuple(rates), *shares, math.inf, 0.0)
    planes = TRAINING * mode.ticks + blocks * length
    return Plan(tuple(rates), *shares, overhead, 8 * size * hz / planes)
