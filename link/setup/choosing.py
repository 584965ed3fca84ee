"""Choice of a mode from pilots: the one foreseen to bring a file soonest.

A pilot sends random data in a mode through the same air and camera. Its wrong bytes, at their upper
limit, give the share of codewords lost (closed form of Reed-Solomon), that the share of frames
lost, that the frames the fountain needs, and those the time. Not every mode is tried: fastest
first, until what is left could not be faster if it made no error; and none that asks for more than
one which failed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding import WORD_BYTES, Blocks
from link.coding.fountain import source_symbols
from link.layout import TRAINING, Layout
from link.line_codes import decode_line
from link.mode import Mode
from link.theory import clopper_pearson, longest_off_run, rs_word_error

__all__ = ["Choice", "Considered", "Trial", "choose", "foresee", "longest_run"]

_HOPELESS: Final = 0.2
"""Bit error rate from which modes that ask for more are not tried."""
_SURE: Final = 1e-6
"""Chance that a file lacks frames for all its overhead."""
_BEYOND: Final = 2
"""Frames beyond the file's own that the fountain is given, as the sender does."""
_LEVEL: Final = 0.999
"""Of the upper limit of the share of wrong bytes."""
_MARGIN: Final = 1.5
"""Times as many as that are reckoned with: a pilot does not see the whole panel."""


@dataclass(frozen=True)
class Trial:
    """What a pilot measured: bits decided and wrong, and the same of the line code's values."""

    bits: int
    errors: int
    values: int
    values_wrong: int

    @classmethod
    def of(cls, mode: Mode, sent: npt.NDArray[np.bool_], soft: npt.NDArray[np.float32]) -> Trial:
        """From symbols in whole groups, (symbols, cells): bits shown and soft values received."""
        whole = len(sent) // mode.code.symbols * mode.code.symbols
        sure = np.where(sent[:whole], np.float32(30), np.float32(-30))
        right, _ = decode_line(mode.line, sure)
        got, _ = decode_line(mode.line, np.asarray(soft[:whole], np.float32))
        return cls(
            sent.size, int(((soft > 0) != sent).sum()), right.size, int((right != got).sum())
        )


@dataclass(frozen=True)
class Considered:
    """A mode that was looked at. ceiling: its goodput without errors, bits a second. why: what
    became of it. Of those tried: errors, the bit error rate; byte, the share of wrong bytes
    reckoned with; lost, of codewords and of frames; overhead, frames to send beyond the file's own
    as a share of them; goodput, 0 where no overhead is enough."""

    mode: Mode
    ceiling: float
    why: str
    errors: float | None = None
    byte: float | None = None
    words_lost: float | None = None
    frames_lost: float | None = None
    overhead: float | None = None
    goodput: float | None = None


@dataclass(frozen=True)
class Choice:
    """mode: the chosen one. holds: False where none is foreseen to work, and the surest was taken.
    rows: every mode, in the order they were looked at."""

    mode: Mode
    holds: bool
    rows: tuple[Considered, ...]


def longest_run(mode: Mode) -> float:
    """Ticks without the panel's light that a mode's line code may bring together."""

    most = mode.code.run_limit
    return math.inf if most is None else most * mode.ticks


def foresee(
    mode: Mode, byte: float, size: int, hz: float, most_overhead: float = 1.0
) -> tuple[float, float, float, float]:
    """(share of codewords lost, of frames lost, overhead, goodput in bits a second) of a file.

    byte: share of bytes wrong, each on its own (the interleaver's work). size: of the file, bytes.
    hz: planes a second. Goodput counts the training and is 0, overhead infinite, where more than
    most_overhead is needed, or where the panel is too small for a frame.
    """
    from scipy.stats import nbinom

    layout = Layout(mode)
    try:
        form = Blocks(layout, True)
    except ValueError:
        return 1.0, 1.0, math.inf, 0.0
    words = float(rs_word_error(WORD_BYTES, WORD_BYTES - mode.parity, byte))
    frames = float(-np.expm1(form.frame_words * np.log1p(-min(words, 1 - 1e-12))))
    needed = source_symbols(size, form.symbol_bytes) + _BEYOND
    # frames lost before so many arrive follow the negative binomial law
    lost = float(nbinom.isf(_SURE, needed, 1 - frames)) if frames < 0.999 else math.inf
    overhead = (_BEYOND + lost) / (needed - _BEYOND)
    if not overhead <= max(most_overhead, _BEYOND / (needed - _BEYOND)):
        return words, frames, math.inf, 0.0
    blocks = math.ceil((needed + lost) / form.frames)
    symbols = TRAINING + blocks * form.groups * layout.group
    return words, frames, overhead, 8 * size * hz / (symbols * mode.ticks)


def _too_long(mode: Mode, threshold: float, background: float) -> bool:
    """Whether a false spike is likely within the line code's longest run of off ticks."""
    if background <= 0:
        return False
    return longest_run(mode) > longest_off_run(threshold, background * threshold)


def _asks_more(mode: Mode, failed: Mode, errors: float) -> bool:
    """Whether a mode can be no better than one that failed, by cell, ticks and, unless there were
    too many errors for any code, by what the line code adds."""
    rate, other = (m.code.bits / m.code.symbols for m in (mode, failed))
    smaller = mode.cell <= failed.cell and mode.ticks <= failed.ticks
    return smaller and (rate >= other or errors > _HOPELESS)


def choose(
    trial: Callable[[Mode], Trial],
    candidates: Iterable[Mode],
    *,
    size: int,
    hz: float,
    threshold: float | None = None,
    background: float = 0.0,
    most_overhead: float = 1.0,
    most_trials: int = 12,
) -> Choice:
    """trial: sends a pilot in a mode; its parity does not matter, so that modes which differ in it
    alone share one. size: of the file, bytes. hz: planes a second. threshold, background:
    electrons, and thresholds that an off tick brings; given for pixels with hard reset, modes whose
    runs are too long are left out, unless all are. Raises ValueError without candidates.
    """
    modes = list(dict.fromkeys(candidates))
    if not modes:
        raise ValueError("candidates must hold at least one mode, not none")
    ceiling = {m: foresee(m, 0.0, size, hz)[3] for m in modes}
    modes.sort(key=lambda m: (-ceiling[m], m.ticks, -m.cell, m.parity))
    long = set()
    if threshold is not None:
        long = {m for m in modes if _too_long(m, threshold, background)}
        long = set() if len(long) == len(modes) else long
    tried: dict[Mode, Trial] = {}
    rows: list[Considered] = []
    failed: list[tuple[Mode, float]] = []
    for mode in modes:
        best = max((row.goodput or 0.0 for row in rows), default=0.0)
        key = replace(mode, parity=modes[0].parity)
        if mode in long:
            rows.append(Considered(mode, ceiling[mode], "its runs of off ticks are too long"))
        elif ceiling[mode] <= best:
            rows.append(Considered(mode, ceiling[mode], "slower than the best"))
        elif any(_asks_more(mode, *one) for one in failed):
            rows.append(Considered(mode, ceiling[mode], "asks for more than one that failed"))
        elif key not in tried and len(tried) >= most_trials:
            rows.append(Considered(mode, ceiling[mode], "no trial left"))
        else:
            if key not in tried:
                tried[key] = trial(mode)
            got = tried[key]
            wrong = float(clopper_pearson(got.values_wrong, got.values, _LEVEL)[1])
            held = max(8 / mode.code.bits, 1.0)  # values to a byte
            byte = min(-_MARGIN * math.expm1(held * math.log1p(-min(wrong, 1 - 1e-12))), 1.0)
            words, frames, overhead, goodput = foresee(mode, byte, size, hz, most_overhead)
            surest = replace(mode, parity=max(m.parity for m in modes))
            if not foresee(surest, byte, size, hz, most_overhead)[3]:
                failed.append((mode, got.errors / got.bits))
            rows.append(
                Considered(
                    mode, ceiling[mode], "tried", got.errors / got.bits, byte, words, frames,
                    overhead, goodput,
                )
            )  # fmt: skip
    measured = [row for row in rows if row.goodput is not None]
    if not measured:  # none was tried: the slowest asks for least
        return Choice(modes[-1], False, tuple(rows))
    if not any(row.goodput for row in measured):
        least = min(measured, key=lambda r: r.byte or 0.0).mode
        return Choice(replace(least, parity=max(m.parity for m in modes)), False, tuple(rows))
    best_row = max(measured, key=lambda r: (r.goodput or 0.0, r.mode.parity))
    return Choice(best_row.mode, True, tuple(rows))
