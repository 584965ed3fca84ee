"""Choice of a mode from pilots: the one predicted to transfer a file in the shortest time.

A pilot sends random data in a mode through the same air and camera. The upper limit of its share of
wrong bytes gives the share of lost codewords (closed form of Reed-Solomon), then of lost frames,
the frames that the fountain needs, and the time. Modes are tried from the fastest on, until the
remaining ones would be slower even without errors. A mode that requires more than a failed one is
not tried.
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
"""Bit error rate from which more demanding modes are not tried."""
_SURE: Final = 1e-6
"""Probability that a file lacks frames in spite of its overhead."""
_BEYOND: Final = 2
"""Frames beyond the file's own, as in the sender."""
_RARE: Final = 24
"""Length of a run of random bits that is taken as the longest: a longer one begins at one symbol in
2^24. In one codeword of 255 bytes in 2^13 it causes a false spike, which the parity corrects."""
_LEVEL: Final = 0.999
"""Confidence of the upper limit of the share of wrong bytes."""
_MARGIN: Final = 1.5
"""Factor on that limit, because a pilot does not cover the whole panel."""


@dataclass(frozen=True)
class Trial:
    """Result of a pilot.

    Attributes:
        bits, errors: bits decided, and wrong ones.
        values, values_wrong: the same for the line code's values.
    """

    bits: int
    errors: int
    values: int
    values_wrong: int

    @classmethod
    def of(cls, mode: Mode, sent: npt.NDArray[np.bool_], soft: npt.NDArray[np.float32]) -> Trial:
        """Returns the result of symbols in whole groups.

        Args:
            mode: of the pilot.
            sent: (symbols, cells) bits shown.
            soft: (symbols, cells) soft values received.
        """
        whole = len(sent) // mode.code.symbols * mode.code.symbols
        sure = np.where(sent[:whole], np.float32(30), np.float32(-30))
        right, _ = decode_line(mode.line, sure)
        got, _ = decode_line(mode.line, np.asarray(soft[:whole], np.float32))
        return cls(
            sent.size, int(((soft > 0) != sent).sum()), right.size, int((right != got).sum())
        )


@dataclass(frozen=True)
class Considered:
    """A mode that was considered. The optional values are those of a mode that was tried.

    Attributes:
        mode: the mode.
        ceiling: its goodput without errors, bit/s.
        why: reason of the result.
        errors: bit error rate.
        byte: assumed share of wrong bytes.
        words_lost, frames_lost: shares of codewords and of frames lost.
        overhead: frames beyond the file's own, as a share of them.
        goodput: bit/s, 0 if no overhead is enough.
    """

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
    """The choice of a mode.

    Attributes:
        mode: the chosen one.
        holds: False if no mode is predicted to work, and the most reliable one was taken.
        rows: every mode, in the order of the search.
    """

    mode: Mode
    holds: bool
    rows: tuple[Considered, ...]


def longest_run(mode: Mode) -> float:
    """Returns the longest run of OFF ticks of a mode's line code, or _RARE scrambled symbols."""
    if mode.format == 2:
        return _RARE * mode.ticks
    most = mode.code.run_limit
    return math.inf if most is None else most * mode.ticks


def foresee(
    mode: Mode, byte: float, size: int, hz: float, most_overhead: float = 1.0
) -> tuple[float, float, float, float]:
    """Predicts the transfer of a file.

    Goodput includes the training. It is 0, and the overhead infinite, if more than most_overhead is
    needed or the panel is too small for a frame.

    Args:
        mode: of the transmission.
        byte: share of wrong bytes, independent because of the interleaver.
        size: of the file, bytes.
        hz: planes per second.
        most_overhead: largest overhead.

    Returns:
        Share of codewords lost, of frames lost, overhead, goodput in bit/s.
    """
    layout = Layout(mode)
    try:
        form = Blocks(layout, True)
    except ValueError:
        return 1.0, 1.0, math.inf, 0.0
    words = float(rs_word_error(WORD_BYTES, WORD_BYTES - mode.parity, byte))
    frames = float(-np.expm1(form.frame_words * np.log1p(-min(words, 1 - 1e-12))))
    needed = source_symbols(size, form.symbol_bytes) + _BEYOND
    lost = _most_lost(needed, 1 - frames) if frames < 0.999 else math.inf
    overhead = (_BEYOND + lost) / (needed - _BEYOND)
    if not overhead <= max(most_overhead, _BEYOND / (needed - _BEYOND)):
        return words, frames, math.inf, 0.0
    blocks = math.ceil((needed + lost) / form.frames)
    symbols = TRAINING + blocks * form.groups * layout.group
    return words, frames, overhead, 8 * size * hz / (symbols * mode.ticks)


def _most_lost(needed: int, arrives: float) -> int:
    """Frames lost before `needed` ones arrive, each with probability `arrives`: the least number
    that is exceeded with at most the probability _SURE. Lost frames have a negative binomial
    distribution."""
    from scipy.special import nbdtrc  # scipy.stats, which has the quantile, takes 0.4 s to load

    low, high = -1, 1
    while nbdtrc(high, needed, arrives) > _SURE:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        if nbdtrc(middle, needed, arrives) > _SURE:
            low = middle
        else:
            high = middle
    return high


def _too_long(mode: Mode, threshold: float, background: float) -> bool:
    """Whether a false spike is likely within the line code's longest run of OFF ticks."""
    if background <= 0:
        return False
    return longest_run(mode) > longest_off_run(threshold, background * threshold)


def _requires_more(mode: Mode, failed: Mode, errors: float) -> bool:
    """Whether a mode cannot be better than a failed one.

    The comparison is by cell, ticks and, unless there were too many errors for any code, the
    redundancy of the line code.
    """
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
    """Chooses a mode.

    Args:
        trial: sends a pilot in a mode. Parity has no influence, so modes that differ only in it
            share a pilot.
        candidates: modes to consider.
        size: of the file, bytes.
        hz: planes per second.
        threshold: electrons, for pixels with hard reset: modes whose runs are too long are then
            excluded, unless all are. None for other pixels.
        background: charge of an OFF tick, thresholds.
        most_overhead: largest overhead of the fountain.
        most_trials: largest number of pilots.

    Raises:
        ValueError: without candidates.
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
        elif any(_requires_more(mode, *one) for one in failed):
            rows.append(Considered(mode, ceiling[mode], "asks for more than one that failed"))
        elif key not in tried and len(tried) >= most_trials:
            rows.append(Considered(mode, ceiling[mode], "no trial left"))
        else:
            if key not in tried:
                tried[key] = trial(mode)
            got = tried[key]
            wrong = float(clopper_pearson(got.values_wrong, got.values, _LEVEL)[1])
            per_byte = max(8 / mode.code.bits, 1.0)  # values of a byte
            byte = min(-_MARGIN * math.expm1(per_byte * math.log1p(-min(wrong, 1 - 1e-12))), 1.0)
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
    if not measured:  # none was tried: the slowest mode requires least
        return Choice(modes[-1], False, tuple(rows))
    if not any(row.goodput for row in measured):
        least = min(measured, key=lambda r: r.byte or 0.0).mode
        return Choice(replace(least, parity=max(m.parity for m in modes)), False, tuple(rows))
    best_row = max(measured, key=lambda r: (r.goodput or 0.0, r.mode.parity))
    return Choice(best_row.mode, True, tuple(rows))
