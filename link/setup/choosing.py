"""Choice of a mode from pilots: the one predicted to transfer a file in the shortest time.

A pilot sends random data in a mode through the same air and camera. The upper limit of its share of
wrong bytes gives the share of lost codewords (closed form of Reed-Solomon); for codes with soft
decisions it is the lower limit of its information per bit that does (`link.theory.words`).
From that follow the share of lost frames, the frames that the fountain needs, and the time. Modes
are tried from the fastest on, until the remaining ones would be slower even without errors. A mode
that requires more than a failed one is not tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import CONFIDENCE
from link.coding import WORD_BYTES, blocks_of
from link.coding.fountain import source_symbols
from link.layout import TRAINING, Layout
from link.line_codes import decode_line
from link.mode import EVERY_RATE, Mode
from link.setup.adapting import Course, plan_rates
from link.theory import clopper_pearson, ldpc_word_error, longest_off_run, rs_word_error
from link.theory.soft_information import soft_information

_HOPELESS: Final = 0.2
"""Bit error rate from which more demanding modes are not tried."""
_SURE: Final = 1e-6
"""Probability that a file lacks frames in spite of its overhead."""
_BEYOND: Final = 2
"""Frames beyond the file's own, as in the sender."""
_RARE: Final = 24
"""Length of a run of random bits that is taken as the longest: a longer one begins at one symbol in
2^24."""
_MARGIN: Final = 1.5
"""Factor on that limit, because a pilot does not cover the whole panel."""
_MISSING: Final = 1.1
"""Factor on what the lower limit of the information lacks of a bit, for the same reason. In runs at
2, 4 and 10 m, other phases, 5 klux and a residual reset, the information was .0010 below to .0045
above that of the pilot (docs/link-theory.md, words with soft decisions)."""
_MISSING_WHOLE: Final = 1.8
"""The same factor where no frame is replaced. In fog of 50 m, 2 m away, one of 34 650 words was
not mended at the rate .955, where the factor above foresees one in 10^13; with this one the rate is
.935."""


@dataclass(frozen=True)
class Trial:
    """Result of a pilot.

    Attributes:
        bits, errors: bits decided, and wrong ones.
        values, values_wrong: the same for the line code's values.
        information: lower limit of the information of a bit with its soft value, of scrambled
            symbols; None for others.
        course: course of the information along the drift of the phase; None if it was tried at one
            phase alone.
    """

    bits: int
    errors: int
    values: int
    values_wrong: int
    information: float | None = None
    course: Course | None = None

    @classmethod
    def of(cls, mode: Mode, sent: npt.NDArray[np.bool_], soft: npt.NDArray[np.float32]) -> Trial:
        """Result of symbols in whole groups.

        Args:
            mode: mode of the pilot.
            sent: (symbols, cells) bits shown.
            soft: (symbols, cells) soft values received.
        """
        whole = len(sent) // mode.code.symbols * mode.code.symbols
        sure = np.where(sent[:whole], np.float32(30), np.float32(-30))
        right, _ = decode_line(mode.line, sure)
        got, _ = decode_line(mode.line, np.asarray(soft[:whole], np.float32))
        information = None
        if mode.format == 2:
            known = soft_information(soft.ravel(), sent.ravel())
            information = None if known is None else known.low
        return cls(
            sent.size, int(((soft > 0) != sent).sum()), right.size, int((right != got).sum()),
            information,
        )  # fmt: skip


@dataclass(frozen=True)
class Considered:
    """A mode that was considered. The optional values are those of a mode that was tried.

    Attributes:
        mode: the mode.
        ceiling: its goodput without errors, bit/s.
        why: reason of the result.
        errors: bit error rate.
        byte: assumed share of wrong bytes; None for a code with soft decisions.
        information: assumed information of a bit; None for the other code.
        words_lost, frames_lost: shares of codewords and of frames lost.
        overhead: frames beyond the file's own, as a share of them.
        goodput: bit/s, 0 if no overhead is enough.
        rates: rates of the blocks, where each has its own; see `link.setup.adapting.Plan`.
    """

    mode: Mode
    ceiling: float
    why: str
    errors: float | None = None
    byte: float | None = None
    information: float | None = None
    words_lost: float | None = None
    frames_lost: float | None = None
    overhead: float | None = None
    goodput: float | None = None
    rates: tuple[int, ...] = ()


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

    @property
    def rates(self) -> tuple[int, ...]:
        """Rates of the blocks of the chosen mode, where each has its own."""
        return next((row.rates for row in self.rows if row.mode == self.mode), ())


def longest_run(mode: Mode) -> float:
    """Longest run of OFF ticks of a mode's line code, or _RARE scrambled symbols."""
    if mode.format == 2:
        return _RARE * mode.ticks
    most = mode.code.run_limit
    return math.inf if most is None else most * mode.ticks


def foresee(
    mode: Mode, words: float, size: int, hz: float, most_overhead: float = 1.0,
    most_lost: float = 1.0,
) -> tuple[float, float, float]:  # fmt: skip
    """Predicts the transfer of a file.

    Goodput includes the training. It is 0, and the overhead infinite, if more than most_overhead is
    needed, more frames than most_lost are lost, or the panel is too small for a frame.

    Args:
        mode: mode of the transmission.
        words: share of codewords lost, independent because of the interleaver.
        size: size of the file, bytes.
        hz: planes per second.
        most_overhead: largest overhead.
        most_lost: largest share of frames lost, where none is replaced.

    Returns:
        Share of frames lost, overhead, goodput in bit/s.
    """
    layout = Layout(mode)
    try:
        form = blocks_of(layout)
    except ValueError:
        return 1.0, math.inf, 0.0
    frames = float(-np.expm1(form.frame_words * np.log1p(-min(words, 1 - 1e-12))))
    if frames > most_lost:
        return frames, math.inf, 0.0
    needed = source_symbols(size, form.symbol_bytes) + _BEYOND
    lost = _most_lost(needed, 1 - frames) if frames < 0.999 else math.inf
    overhead = (_BEYOND + lost) / (needed - _BEYOND)
    if not overhead <= max(most_overhead, _BEYOND / (needed - _BEYOND)):
        return frames, math.inf, 0.0
    blocks = math.ceil((needed + lost) / form.frames)
    symbols = TRAINING + blocks * form.groups * layout.group
    return frames, overhead, 8 * size * hz / (symbols * mode.ticks)


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


@dataclass(frozen=True)
class _Assumed:
    """What a pilot lets assume of a mode: share of wrong bytes or information, and share of words
    lost."""

    byte: float | None
    information: float | None
    words: float


def _counted_on(information: float | None, missing: float = _MISSING) -> float:
    """Information that is assumed, of that of a pilot. missing: factor on what it lacks."""
    return max(1 - missing * (1 - (information or 0.0)), 0.0)


def _assume(mode: Mode, got: Trial, most_lost: float) -> _Assumed:
    if mode.parity is None:
        missing = _MISSING if most_lost >= 1 else _MISSING_WHOLE
        information = _counted_on(got.information, missing)
        rate = min(EVERY_RATE) if mode.rate is None else mode.rate
        return _Assumed(None, information, ldpc_word_error(rate, information))
    wrong = float(clopper_pearson(got.values_wrong, got.values, CONFIDENCE)[1])
    per_byte = max(8 / mode.code.bits, 1.0)  # values of a byte
    byte = min(-_MARGIN * math.expm1(per_byte * math.log1p(-min(wrong, 1 - 1e-12))), 1.0)
    words = float(rs_word_error(WORD_BYTES, WORD_BYTES - mode.parity, byte))
    return _Assumed(byte, None, words)


def _weighed(
    mode: Mode, ceiling: float, got: Trial, size: int, hz: float, most_overhead: float,
    most_lost: float,
) -> Considered:  # fmt: skip
    """What a pilot lets expect of a mode."""
    assumed, errors = _assume(mode, got, most_lost), got.errors / got.bits
    if mode.adaptive:
        course = got.course or Course((0.0,), (got.information or 0.0,), 0.0)
        plan = plan_rates(mode, course, _counted_on, size, hz, most_overhead)
        return Considered(
            mode, ceiling, "tried", errors, None, assumed.information, plan.words, plan.frames,
            plan.overhead, plan.goodput, plan.rates,
        )  # fmt: skip
    frames, overhead, goodput = foresee(mode, assumed.words, size, hz, most_overhead, most_lost)
    return Considered(
        mode, ceiling, "tried", errors, assumed.byte, assumed.information, assumed.words, frames,
        overhead, goodput,
    )  # fmt: skip


def _too_long(mode: Mode, threshold: float, background: float, on: float) -> bool:
    """Whether a false spike is likely within the line code's longest run of OFF ticks.

    Runs of scrambled symbols are those of the pilot, which has measured what they cost. But where
    little light comes through haze, its few columns of pilots are too faint for the receiver's
    clock: at 2 m it was lost with a visibility of 20 m, and kept with 30 m, and at 5 klux.
    """
    if background <= 0 or (mode.format == 2 and on >= 1):
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
    on: float = 1.0,
    most_overhead: float = 1.0,
    most_lost: float = 1.0,
    most_trials: int = 12,
) -> Choice:
    """Chooses a mode.

    Args:
        trial: sends a pilot in a mode. The code of the words has no influence, so modes that differ
            only in it share a pilot.
        candidates: modes to consider.
        size: size of the file, bytes.
        hz: planes per second.
        threshold: electrons, for pixels with hard reset: modes whose runs are too long are then
            excluded, unless all are. None for other pixels.
        background, on: charge of an OFF tick, and what an ON tick adds to it, thresholds.
        most_overhead: largest overhead of the fountain.
        most_lost: largest share of frames lost, as in `foresee`.
        most_trials: largest number of pilots.

    Raises:
        ValueError: without candidates.
    """
    modes = list(dict.fromkeys(candidates))
    if not modes:
        raise ValueError("candidates must hold at least one mode, not none")
    ceiling = {m: foresee(m, 0.0, size, hz)[2] for m in modes}
    # Of equally fast ones those with soft decisions first: a missing symbol erases an eighth of
    # their bits, and a bit of every byte of Reed-Solomon.
    modes.sort(key=lambda m: (-ceiling[m], m.ticks, -m.cell, m.parity is not None, m.word_rate))
    long = set()
    if threshold is not None:
        long = {m for m in modes if _too_long(m, threshold, background, on)}
        long = set() if len(long) == len(modes) else long
    tried: dict[tuple[int, int, str], Trial] = {}
    rows: list[Considered] = []
    failed: list[tuple[Mode, float]] = []
    best = 0.0
    for mode in modes:
        key = mode.symbols
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
            limits = size, hz, most_overhead, most_lost
            alike = [m for m in modes if m.symbols == key]
            if not any(_weighed(m, ceiling[m], got, *limits).goodput for m in alike):
                failed.append((mode, got.errors / got.bits))
            rows.append(_weighed(mode, ceiling[mode], got, *limits))
            best = max(best, rows[-1].goodput or 0.0)
    measured = [row for row in rows if row.goodput is not None]
    if not measured:  # none was tried: the slowest mode requires least
        return Choice(modes[-1], False, tuple(rows))
    if not any(row.goodput for row in measured):
        least = min(measured, key=lambda r: r.errors or 0.0).mode
        alike = [m for m in modes if m.symbols == least.symbols]
        return Choice(min(alike, key=lambda m: m.word_rate), False, tuple(rows))
    best_row = max(
        measured, key=lambda r: (r.goodput or 0.0, r.mode.parity is None, -r.mode.word_rate)
    )
    return Choice(best_row.mode, True, tuple(rows))
