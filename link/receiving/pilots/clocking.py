"""Timing of symbols in the camera's ticks, from the pilots in each band of rows.

All pilots show the same maximal-length sequence, so a section of it identifies the symbol. Its
phase in each band of rows gives the first symbol's tick, the period (the clock offset) and the
slope over the rows, by one robust plane fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.receiving.pilots.sequence import (
    PilotSignal,
    sequence_peak,
    sequence_values,
    shows_sequence,
)
from link.timing import Timing

Floats = npt.NDArray[np.float64]
_STRETCH: Final = (192, 40)
"""Smallest length of the search, ticks and symbols."""
_TRUSTED: Final = 6.0
"""Smallest height of the peak above the mean, standard deviations."""
_REACH: Final = 2.0
"""Range around the common peak of the phases of bands and sections, ticks."""
_STEP: Final = 0.125
"""Step of the phases that are tried, ticks."""
_SPAN: Final = (48, 24)
"""Smallest length of a section with a phase of its own, ticks and symbols."""


@dataclass(frozen=True)
class Clocking:
    """The timing by the pilots.

    Attributes:
        timing: timing of the symbols.
        score: height of the peak of the sequence over the rest, standard deviations.
        scatter: scatter of bands and sections about the timing, ticks rms.
        lit: ticks of the unbroken sequence.
        broken: whether the panel is on in other ticks as well.
    """

    timing: Timing
    score: float
    scatter: float
    lit: tuple[int, int]
    broken: bool = False

    @property
    def span(self) -> float:
        """Ticks over which the period was measured."""
        return float(self.lit[1] - self.lit[0])


def clock_by_pilots(
    signal: PilotSignal, layout: Layout, rows: int, lit: tuple[int, int]
) -> Clocking | None:
    """Timing; None if the pilots are not visible.

    Args:
        signal: spikes of the pilots.
        layout: layout of the mode.
        rows: number of rows of the image.
        lit: ticks in which the panel is on.

    Returns:
        The timing, whose `first` is that of a symbol with a number that is a multiple of PERIOD.
    """
    nominal = float(layout.mode.ticks)
    low, high = max(lit[0] - signal.first, 0), min(lit[1] - signal.first, len(signal.bits))
    if high - low < max(8, 4 * nominal):
        return None
    want = int(max(_STRETCH[0], _STRETCH[1] * nominal))
    begin = low + max(0, (high - low - want) // 2)
    stop = min(begin + want, high)
    weights = signal.pixels / signal.pixels.sum()
    total = signal.bits @ weights
    lag, score = sequence_peak(total[begin:stop], nominal)
    broken = False
    if score < _TRUSTED or not _runs_through(total, nominal, begin, stop, lag):
        # The sequence may be interrupted and begin again.
        stretch = _unbroken(total, nominal, low, high, want)
        if stretch is not None:
            begin, stop, lag, score = stretch
            low, high = _reaches(total, nominal, (low, high), (begin, stop), lag)
            broken = True
        elif score < _TRUSTED:
            return None
    rough = signal.first + begin - lag
    clocking = _plane(signal, nominal, rows, (low, high), rough, score, (begin + stop) / 2)
    return replace(clocking, broken=broken) if clocking is not None else None


def _unbroken(
    total: Floats, nominal: float, low: int, high: int, want: int
) -> tuple[int, int, float, float] | None:
    """(begin, stop, lag, score) of the first section that shows the sequence, long ones first."""
    for length in (want, want // 2):
        for begin in range(low, high - length + 1, length // 4):
            lag, score = sequence_peak(total[begin : begin + length], nominal)
            through = _runs_through(total, nominal, begin, begin + length, lag)
            if score >= _TRUSTED and through:
                return begin, begin + length, lag, score
    return None


def _runs_through(total: Floats, nominal: float, begin: int, stop: int, lag: float) -> bool:
    """Whether each quarter of a section shows the same sequence as the whole."""
    edges = np.linspace(begin, stop, 5).astype(int)
    return all(
        shows_sequence(total, nominal, int(a), int(b), begin - lag) for a, b in pairwise(edges)
    )


def _reaches(
    total: Floats, nominal: float, lit: tuple[int, int], stretch: tuple[int, int], lag: float
) -> tuple[int, int]:
    """Extent of the sequence around a section, to a quarter of the section."""
    step = max((stretch[1] - stretch[0]) // 4, 8)

    first = stretch[0] - lag
    low, high = stretch
    while low > lit[0] and shows_sequence(total, nominal, max(low - step, lit[0]), low, first):
        low = max(low - step, lit[0])
    while high < lit[1] and shows_sequence(total, nominal, high, min(high + step, lit[1]), first):
        high = min(high + step, lit[1])
    return low, high


def _plane(
    signal: PilotSignal, nominal: float, rows: int, lit: tuple[int, int], rough: float,
    score: float, reference: float,
) -> Clocking | None:  # fmt: skip
    """Fits a plane through the phases of bands and sections."""
    period, first, slope = nominal, rough, 0.0
    middle = signal.first + reference
    scatter = np.inf
    for reach in (_REACH, _REACH / 2):
        phases = _phases(signal, period, first, slope, rows, lit, reach)
        if phases is None:
            return None
        tick, row, delay, weight = phases
        # delay = a + b (tick - middle) + c row / rows, weighted, outliers rejected
        design = np.stack([np.ones_like(tick), (tick - middle) / 1000, row / rows], 1)
        keep = np.ones(len(delay), np.bool_)
        flat = np.ptp(tick) < 1
        alike = np.ptp(row) < rows / 50
        for _ in range(4):
            used = design[keep] * weight[keep, None]
            ridge = np.diag([1e-9, 1e9 if flat else 1e-9, 1e9 if alike else 1e-9])
            solved = np.linalg.solve(used.T @ used + ridge, used.T @ (delay[keep] * weight[keep]))
            off = delay - design @ solved
            width = 1.4826 * float(np.median(np.abs(off[keep]))) + 0.02
            keep = np.abs(off) < 3 * width
            if np.count_nonzero(keep) < 3:
                return None
        a, b, c = (float(value) for value in solved)
        # The growth with time changes the period; the plane gives the first symbol.
        drift = b / 1000
        symbols = (middle - first) / period
        period_new = period * (1 + drift)
        first = first + a + symbols * (period - period_new)
        period = period_new
        slope += c
        scatter = float(np.sqrt(np.mean(off[keep] ** 2)))
    return Clocking(
        Timing(first, period, slope, rows),
        score,
        scatter,
        (signal.first + lit[0], signal.first + lit[1]),
    )


def _phases(
    signal: PilotSignal, period: float, first: float, slope: float, rows: int,
    lit: tuple[int, int], reach: float,
) -> tuple[Floats, Floats, Floats, Floats] | None:  # fmt: skip
    """(tick, row, delay, weight) of each band in each section whose peak lies within reach."""
    length = int(max(_SPAN[0], _SPAN[1] * period))
    count = max(1, (lit[1] - lit[0]) // length)
    offsets = np.arange(-reach, reach + _STEP / 2, _STEP)
    out: list[tuple[float, float, float, float]] = []
    edges = np.linspace(lit[0], lit[1], count + 1).astype(int)
    for a, b in pairwise(edges):
        ticks = np.arange(a, b, dtype=np.float64) + signal.first
        part = signal.bits[a:b] - signal.bits[a:b].mean(0)
        for n, row in enumerate(signal.rows):
            code = sequence_values(first + slope * row / rows + offsets, period, ticks)
            code -= code.mean(1, keepdims=True)
            norm = np.linalg.norm(code, axis=1)
            match = code @ part[:, n] / np.where(norm > 0, norm, 1)
            at = int(np.argmax(match))
            size = float(np.linalg.norm(part[:, n]))
            if size <= 0 or match[at] < 0.35 * size:
                continue
            delay = offsets[at]
            if 0 < at < len(offsets) - 1:
                left, peak, right = match[at - 1 : at + 2]
                bend = left - 2 * peak + right
                if bend < 0:
                    delay += _STEP * 0.5 * float(left - right) / bend
            weight = float(np.sqrt(signal.pixels[n])) * float(match[at]) / size
            out.append(((a + b) / 2 + signal.first, float(row), float(delay), weight))
    if len(out) < 3:
        return None
    tick, row_, delay_, weight_ = np.array(out).T
    return tick, row_, delay_, weight_
