"""Choice of a mode: the fastest one whose pilot says that its codewords will hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from link.coding import decode_line
from link.layout import GROUP_BITS, Layout
from link.mode import Mode
from link.theory import clopper_pearson, rs_word_error
from scenarios.link_run.pilot import Pilot

__all__ = ["Choice", "Weighed", "choose", "coded_rate"]

_HOLDS = 1e-4
"""Codewords that may be lost."""
_LEVEL = 0.999
"""Of the upper limit of the byte error rate that they are foreseen from."""
_MARGIN = 1.5
"""Times as many wrong bytes as that are reckoned with: the strip is not the whole panel."""
_PILOTS = 8
"""At most."""


@dataclass(frozen=True)
class Weighed:
    """A mode that was looked at. errors: raw bit error rate of its pilot. bytes_wrong: share of
    line-code values decided wrong, the upper limit. lost: codewords foreseen to be lost. goodput:
    bits a second foreseen, 0 where too many are lost."""

    mode: Mode
    errors: float
    bytes_wrong: float
    lost: float
    goodput: float


@dataclass
class Choice:
    """mode: the chosen one. rows: every mode that was weighed. holds: False where none of them is
    foreseen to work, and the surest was taken."""

    mode: Mode
    holds: bool
    rows: list[Weighed] = field(default_factory=list)

    def best(self, count: int) -> list[Weighed]:
        """By goodput, then by how sure they are."""
        return sorted(self.rows, key=lambda r: (-r.goodput, r.lost))[:count]


def coded_rate(mode: Mode, hz: float) -> float:
    """Bits a second that line code and Reed-Solomon leave. hz: planes a second."""
    layout = Layout(mode)
    line = GROUP_BITS[mode.line] / layout.group
    return layout.cells * hz / mode.ticks * line * (255 - mode.parity) / 255


def _weigh(mode: Mode, pilot: Pilot, parities: Iterable[int], hz: float) -> list[Weighed]:
    group = Layout(mode).group
    whole = len(pilot.soft) // group * group
    sent, _ = decode_line(mode.line, np.where(pilot.sent[:whole], 30.0, -30.0).astype(np.float32))
    got, _ = decode_line(mode.line, pilot.soft[:whole])
    wrong = float(clopper_pearson(int((sent != got).sum()), sent.size, _LEVEL)[1])
    values = max(round(8 / GROUP_BITS[mode.line]), 1)
    byte = min(_MARGIN * (1 - (1 - wrong) ** values), 1.0)
    out = []
    for parity in parities:
        each = replace(mode, parity=parity)
        lost = float(rs_word_error(255, 255 - parity, byte))
        rate = coded_rate(each, hz) if lost < _HOLDS else 0.0
        out.append(Weighed(each, pilot.errors / pilot.sent.size, wrong, lost, rate))
    return out


def choose(
    trial: Callable[[Mode], Pilot], candidates: Iterable[Mode], parities: Iterable[int], hz: float,
) -> Choice:  # fmt: skip
    """candidates: of any parity, which does not change the pilot; the fastest are tried first, and
    no more once one holds that is faster than what is left could be. hz: planes a second."""
    parities = sorted(parities)
    fast = sorted(candidates, key=lambda m: -coded_rate(replace(m, parity=parities[0]), hz))
    rows: list[Weighed] = []
    for n, mode in enumerate(fast):
        best = max((row.goodput for row in rows), default=0.0)
        if coded_rate(replace(mode, parity=parities[0]), hz) <= best or n >= _PILOTS:
            break
        rows += _weigh(mode, trial(mode), parities, hz)
    best = max(rows, key=lambda r: (r.goodput, -r.lost, r.mode.parity))
    return Choice(best.mode, best.goodput > 0, rows)
