"""When symbols fall on the camera's ticks, read from the pilots row by row.

All pilots show the same maximal-length sequence, so one stretch of it says which symbol it is, and
its phase in each band of rows gives the first symbol's tick, the period (the clocks' offset) and
the rows' slope by one robust plane fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import PERIOD, Layout, pilots
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.timing import Timing

__all__ = ["Clocking", "PilotSignal", "clock_by_pilots", "global_clock", "pilot_signal"]

Floats = npt.NDArray[np.float64]
_BANDS: Final = 32
"""Of camera rows, at most."""
_PHASES: Final = 4
"""Steps of a tick in the search for the sequence."""
_STRETCH: Final = (192, 40)
"""Of the search: ticks and symbols at least."""
_TRUSTED: Final = 6.0
"""Standard deviations of other places that the peak stands above their mean at least."""
_REACH: Final = 2.0
"""Ticks around the common peak in which bands and stretches may lie."""
_STEP: Final = 0.125
"""Ticks between phases that are tried for them."""
_SHOWS: Final = 0.4
"""Correlation from which a quarter of a stretch shows the same sequence."""
_SPAN: Final = (48, 24)
"""Of a stretch that has a phase of its own: ticks and symbols at least."""


@dataclass(frozen=True, eq=False)
class PilotSignal:
    """bits: share of pilot pixels of a band that fire in each tick, (ticks, bands) float64 from
    tick `first` on. rows: mean camera row of each band. pixels: of each band."""

    first: int
    bits: Floats
    rows: Floats
    pixels: npt.NDArray[np.intp]


@dataclass(frozen=True)
class Clocking:
    """timing; score: how far the sequence's peak stands above the rest, standard deviations;
    scatter: of bands and stretches about the timing, ticks rms. lit: ticks that they lie in, where
    the sequence runs through; broken: whether that is not all of those in which the panel is on."""

    timing: Timing
    score: float
    scatter: float
    lit: tuple[int, int]
    broken: bool = False

    @property
    def span(self) -> float:
        """Ticks over which the period was measured."""
        return float(self.lit[1] - self.lit[0])


def pilot_pixels(
    layout: Layout, homography: Floats, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Camera rows and columns of pixels that lie well within pilots."""
    row, column = np.nonzero(layout.pilot)
    cell = layout.mode.cell
    scale = float(np.sqrt(abs(np.linalg.det(homography[:2, :2]))))
    count = max(1, min(4, int(cell * scale)))
    inner = (np.arange(count) - (count - 1) / 2) * cell / count
    middle = (cell - 1) / 2
    dx, dy = (a.ravel() for a in np.meshgrid(inner, inner))
    x = (column[:, None] * cell + middle + dx).ravel()
    y = (row[:, None] * cell + middle + dy).ravel()
    u, v = project(homography, x, y)
    u, v = np.rint(u), np.rint(v)
    seen = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    flat = np.unique(v[seen].astype(np.intp) * shape[1] + u[seen].astype(np.intp))
    return flat // shape[1], flat % shape[1]


def pilot_signal(recording: Recording, layout: Layout, homography: Floats) -> PilotSignal | None:
    """None where no pilot is in view."""
    rows, columns = pilot_pixels(layout, homography, recording.shape)
    if not len(rows) or not recording.ticks:
        return None
    height = rows[-1] - rows[0] + 1  # rows come in order
    bands = int(np.clip(height // 4, 1, _BANDS))
    of = (rows - rows[0]) * bands // height
    kept, starts = np.unique(of, return_index=True)
    bits = recording.pixels(rows, columns)
    total = np.add.reduceat(bits, starts, axis=1, dtype=np.int64)
    pixels = np.diff(np.append(starts, len(rows)))
    middle = np.add.reduceat(rows.astype(np.float64), starts) / pixels
    assert len(kept) == total.shape[1]
    return PilotSignal(recording.first, total / pixels, middle, pixels)


def _shown(first: npt.ArrayLike, period: float, ticks: Floats) -> Floats:
    """+-1 of the pilots over ticks [k, k + 1), shape of first x ticks; 0 has no meaning."""
    code = np.where(pilots(), 1.0, -1.0)
    total = np.concatenate([[0.0], np.cumsum(code)])
    # integral of the sequence from symbol 0, linear within symbols; differences give the mean

    def integral(at: Floats) -> Floats:
        n = np.floor(at).astype(np.int64)
        turn, rest = np.divmod(n, PERIOD)
        return turn * total[-1] + total[rest] + (at - n) * code[rest]

    begin = (ticks - np.asarray(first, np.float64)[..., None]) / period
    return (integral(begin + 1 / period) - integral(begin)) * period


def _peak(signal: Floats, symbol: float) -> tuple[float, float]:
    """Place of symbol 0 before the signal's first tick, in ticks within [0, PERIOD ticks) as a
    lag of the sequence, and the score. `symbol`: ticks to a symbol."""
    span = int(np.ceil(PERIOD * symbol))
    size = int(2 ** np.ceil(np.log2(span + 2 * len(signal))))
    level = signal - signal.mean()
    spectrum = np.conj(np.fft.rfft(level, size))
    best, score = 0.0, -np.inf
    for phase in range(_PHASES):
        lag = phase / _PHASES
        code = _shown(np.array(-lag), symbol, np.arange(span + len(signal), dtype=np.float64))
        found = np.fft.irfft(np.fft.rfft(code, size) * spectrum, size)[:span]
        at = int(np.argmax(found))
        spread = float(np.std(found))
        above = float(found[at]) / spread if spread > 0 else 0.0
        if above > score:
            best, score = at + lag, above
    return best, score


def clock_by_pilots(
    signal: PilotSignal, layout: Layout, rows: int, lit: tuple[int, int]
) -> Clocking | None:
    """The timing for an image of `rows` rows, from ticks `lit` in which the panel is on. `first` is
    that of some symbol whose number is a multiple of PERIOD. None where the pilots do not show."""
    nominal = float(layout.mode.ticks)
    low, high = max(lit[0] - signal.first, 0), min(lit[1] - signal.first, len(signal.bits))
    if high - low < max(8, 4 * nominal):
        return None
    want = int(max(_STRETCH[0], _STRETCH[1] * nominal))
    begin = low + max(0, (high - low - want) // 2)
    stop = min(begin + want, high)
    weights = signal.pixels / signal.pixels.sum()
    total = signal.bits @ weights
    lag, score = _peak(total[begin:stop], nominal)
    broken = False
    if score < _TRUSTED or not _runs_through(total, nominal, begin, stop, lag):
        # the sequence may break off in the middle, and begin anew
        found = _unbroken(total, nominal, low, high, want)
        if found is not None:
            begin, stop, lag, score = found
            low, high = _reaches(total, nominal, (low, high), (begin, stop), lag)
            broken = True
        elif score < _TRUSTED:
            return None
    rough = signal.first + begin - lag
    told = _plane(signal, nominal, rows, (low, high), rough, score, (begin + stop) / 2)
    return replace(told, broken=broken) if told is not None else None


def _unbroken(
    total: Floats, nominal: float, low: int, high: int, want: int
) -> tuple[int, int, float, float] | None:
    """(begin, stop, lag, score) of the first stretch that shows the sequence, long ones before
    short ones."""
    for length in (want, want // 2):
        for begin in range(low, high - length + 1, length // 4):
            lag, score = _peak(total[begin : begin + length], nominal)
            through = _runs_through(total, nominal, begin, begin + length, lag)
            if score >= _TRUSTED and through:
                return begin, begin + length, lag, score
    return None


def _shows(total: Floats, nominal: float, a: int, b: int, first: float) -> bool:
    """Whether ticks a to b show the sequence that begins at tick `first`."""
    code = _shown(np.array(first), nominal, np.arange(a, b, dtype=np.float64))
    if b - a < 8 or np.ptp(code) == 0 or np.ptp(total[a:b]) == 0:
        return False
    return float(np.corrcoef(code, total[a:b])[0, 1]) > _SHOWS


def _runs_through(total: Floats, nominal: float, begin: int, stop: int, lag: float) -> bool:
    """Whether each quarter of a stretch shows what all of it does."""
    edges = np.linspace(begin, stop, 5).astype(int)
    return all(_shows(total, nominal, int(a), int(b), begin - lag) for a, b in pairwise(edges))


def _reaches(
    total: Floats, nominal: float, lit: tuple[int, int], stretch: tuple[int, int], lag: float
) -> tuple[int, int]:
    """How far the sequence that a stretch shows runs through, to a quarter of the stretch."""
    step = max((stretch[1] - stretch[0]) // 4, 8)

    first = stretch[0] - lag
    low, high = stretch
    while low > lit[0] and _shows(total, nominal, max(low - step, lit[0]), low, first):
        low = max(low - step, lit[0])
    while high < lit[1] and _shows(total, nominal, high, min(high + step, lit[1]), first):
        high = min(high + step, lit[1])
    return low, high


def _plane(
    signal: PilotSignal, nominal: float, rows: int, lit: tuple[int, int], rough: float,
    score: float, reference: float,
) -> Clocking | None:  # fmt: skip
    """Phases of bands and stretches, and the plane through them."""
    period, first, slope = nominal, rough, 0.0
    middle = signal.first + reference
    scatter = np.inf
    for reach in (_REACH, _REACH / 2):
        found = _phases(signal, period, first, slope, rows, lit, reach)
        if found is None:
            return None
        tick, row, late, weight = found
        # late = a + b (tick - middle) + c row / rows, weighted, far ones let go
        design = np.stack([np.ones_like(tick), (tick - middle) / 1000, row / rows], 1)
        keep = np.ones(len(late), np.bool_)
        flat = np.ptp(tick) < 1
        alike = np.ptp(row) < rows / 50
        for _ in range(4):
            used = design[keep] * weight[keep, None]
            ridge = np.diag([1e-9, 1e9 if flat else 1e-9, 1e9 if alike else 1e-9])
            solved = np.linalg.solve(used.T @ used + ridge, used.T @ (late[keep] * weight[keep]))
            off = late - design @ solved
            width = 1.4826 * float(np.median(np.abs(off[keep]))) + 0.02
            keep = np.abs(off) < 3 * width
            if np.count_nonzero(keep) < 3:
                return None
        a, b, c = (float(value) for value in solved)
        # the period takes what grows with time, the first symbol stays where the plane says
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
    """(tick, row, lateness, weight) of each band in each stretch whose peak lies within reach."""
    length = int(max(_SPAN[0], _SPAN[1] * period))
    count = max(1, (lit[1] - lit[0]) // length)
    offsets = np.arange(-reach, reach + _STEP / 2, _STEP)
    out: list[tuple[float, float, float, float]] = []
    edges = np.linspace(lit[0], lit[1], count + 1).astype(int)
    for a, b in pairwise(edges):
        ticks = np.arange(a, b, dtype=np.float64) + signal.first
        part = signal.bits[a:b] - signal.bits[a:b].mean(0)
        for n, row in enumerate(signal.rows):
            code = _shown(first + slope * row / rows + offsets, period, ticks)
            code -= code.mean(1, keepdims=True)
            norm = np.linalg.norm(code, axis=1)
            match = code @ part[:, n] / np.where(norm > 0, norm, 1)
            at = int(np.argmax(match))
            size = float(np.linalg.norm(part[:, n]))
            if size <= 0 or match[at] < 0.35 * size:
                continue
            late = offsets[at]
            if 0 < at < len(offsets) - 1:
                left, peak, right = match[at - 1 : at + 2]
                bend = left - 2 * peak + right
                if bend < 0:
                    late += _STEP * 0.5 * float(left - right) / bend
            weight = float(np.sqrt(signal.pixels[n])) * float(match[at]) / size
            out.append(((a + b) / 2 + signal.first, float(row), float(late), weight))
    if len(out) < 3:
        return None
    tick, row_, late_, weight_ = np.array(out).T
    return tick, row_, late_, weight_


def global_clock(
    totals: Floats, ticks: tuple[int, ...], most: float, step: float
) -> tuple[int, float, float]:
    """Ticks to a symbol, parts per million by which the panel's clock is fast, and the score of the
    pilots in the spikes of a whole image, (ticks,), wherever they stand in it: all pilots are on
    and off together, data are not. Clocks from -most to most ppm are tried, `step` apart."""
    best = (ticks[0], 0.0, -np.inf)
    level = totals - totals.mean()
    if not level.any():
        return best[0], 0.0, 0.0
    for nominal in ticks:
        if len(totals) < 24 * nominal:
            continue
        for ppm in np.arange(-most, most + step / 2, step):
            _, score = _peak(level, nominal / (1 + ppm * 1e-6))
            if score > best[2]:
                best = (nominal, float(ppm), score)
    return best
