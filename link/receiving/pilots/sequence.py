"""The sequence of the pilots in a recording: its begin, its clock, and ticks that are missing.

The signal of the pilots is their spikes, band by band of camera rows.

A camera or a file that drops a tick moves all that follows one tick ahead. A transmission that is
longer than the searched ticks loses a block by that. A short one is lost: its only timing is then
wrong before the gap or after it, and for the detector that learns across it in both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import PERIOD, Layout, pilots
from link.receiving.recording import Gap, Recording
from link.receiving.refining import project

Floats = npt.NDArray[np.float64]
_BANDS: Final = 32
"""Bands of camera rows, at most."""
_PHASES: Final = 4
"""Steps of a tick in the search for the sequence."""
_SHOWS: Final = 0.4
"""Correlation from which a quarter of a section shows the same sequence."""
_MOST: Final = 8
"""Missing ticks at a place, at most. Where more are missing the light may have been broken."""
_NEAR: Final = 1.0
"""Ticks on each side of the peak of the sequence in which its begin is searched."""
_STEP: Final = 0.25
"""Step of that search, and of the drift, ticks."""
_DRIFT: Final = 3.0
"""Largest drift of the clocks over the searched ticks that may explain the pilots without a gap,
ticks: that of 2000 parts per million over 1000 ticks, and what a gap itself resembles."""
_NOISE: Final = 0.05
"""Least standard deviation of the pilots' spikes about a straight line, share of their range."""
_NATS: Final = 15.0
"""Log likelihood ratio from which a gap is believed, over the best explanation without one. Some
10 000 places and lengths are compared: ln of that is 9."""
_EXPLAINED: Final = 0.6
"""Share of the pilots' variance that a gap must explain, together with the sequence."""
_LIKELY: Final = 5.0
"""Nats below the likeliest place of a gap within which others count."""


@dataclass(frozen=True, eq=False)
class PilotSignal:
    """Spikes of the pilots in bands of camera rows.

    Attributes:
        first: first tick.
        bits: (ticks, bands) share of the pilot pixels of a band that fire in each tick.
        rows: (bands,) mean camera row.
        pixels: (bands,) number of pixels.
    """

    first: int
    bits: Floats
    rows: Floats
    pixels: npt.NDArray[np.intp]


def pilot_signal(recording: Recording, layout: Layout, homography: Floats) -> PilotSignal | None:
    """Spikes of the pilots in a recording; None if no pilot is in view."""
    rows, columns = _pilot_pixels(layout, homography, recording.shape)
    if not len(rows) or not recording.ticks:
        return None
    height = rows[-1] - rows[0] + 1  # rows come in order
    bands = int(np.clip(height // 4, 1, _BANDS))
    band = (rows - rows[0]) * bands // height
    present, starts = np.unique(band, return_index=True)
    bits = recording.pixels(rows, columns)
    total = np.add.reduceat(bits, starts, axis=1, dtype=np.int64)
    pixels = np.diff(np.append(starts, len(rows)))
    middle = np.add.reduceat(rows.astype(np.float64), starts) / pixels
    assert len(present) == total.shape[1]
    return PilotSignal(recording.first, total / pixels, middle, pixels)


def _pilot_pixels(
    layout: Layout, homography: Floats, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Camera rows and columns of the pixels well inside pilots."""
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
    in_view = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    flat = np.unique(v[in_view].astype(np.intp) * shape[1] + u[in_view].astype(np.intp))
    return flat // shape[1], flat % shape[1]


def global_clock(
    totals: Floats, ticks: tuple[int, ...], most: float, step: float
) -> tuple[int, float, float]:
    """Ticks of a symbol, the offset of the panel's clock, ppm, and the score.

    All pilots are on and off together, while data are random, so the spikes of the whole image show
    the sequence wherever the panel is.

    Args:
        totals: (ticks,) spikes of the whole image.
        ticks: lengths of a symbol that are tried.
        most, step: clocks from -most to most, ppm, are tried, `step` apart.
    """
    best = (ticks[0], 0.0, -np.inf)
    level = totals - totals.mean()
    if not level.any():
        return best[0], 0.0, 0.0
    for nominal in ticks:
        if len(totals) < 24 * nominal:
            continue
        for ppm in np.arange(-most, most + step / 2, step):
            _, score = sequence_peak(level, nominal / (1 + ppm * 1e-6))
            if score > best[2]:
                best = (nominal, float(ppm), score)
    return best


def shows_sequence(total: Floats, nominal: float, a: int, b: int, first: float) -> bool:
    """Whether ticks a to b show the sequence that begins at tick `first`."""
    code = sequence_values(np.array(first), nominal, np.arange(a, b, dtype=np.float64))
    if b - a < 8 or np.ptp(code) == 0 or np.ptp(total[a:b]) == 0:
        return False
    return float(np.corrcoef(code, total[a:b])[0, 1]) > _SHOWS


def sequence_peak(signal: Floats, symbol: float) -> tuple[float, float]:
    """Lag of the best match of the sequence with a signal, and the score of the match.

    The lag is the number of ticks, within [0, PERIOD symbols), by which symbol 0 precedes the first
    tick of the signal. The score is the height of the peak in standard deviations.

    Args:
        signal: (ticks,) spikes.
        symbol: ticks of a symbol.
    """
    span = int(np.ceil(PERIOD * symbol))
    size = int(2 ** np.ceil(np.log2(span + 2 * len(signal))))
    level = signal - signal.mean()
    spectrum = np.conj(np.fft.rfft(level, size))
    best, score = 0.0, -np.inf
    for phase in range(_PHASES):
        lag = phase / _PHASES
        code = sequence_values(
            np.array(-lag), symbol, np.arange(span + len(signal), dtype=np.float64)
        )
        match = np.fft.irfft(np.fft.rfft(code, size) * spectrum, size)[:span]
        at = int(np.argmax(match))
        spread = float(np.std(match))
        above = float(match[at]) / spread if spread > 0 else 0.0
        if above > score:
            best, score = at + lag, above
    return best, score


def sequence_values(first: npt.ArrayLike, period: float, ticks: Floats) -> Floats:
    """Mean of the sequence, +-1, over ticks [k, k + 1), of the shape of first x ticks.

    Args:
        first: tick at which symbol 0 begins.
        period: ticks of a symbol.
        ticks: (ticks,) k.
    """
    code = np.where(pilots(), 1.0, -1.0)
    total = np.concatenate([[0.0], np.cumsum(code)])
    # Integral of the sequence from symbol 0, linear within symbols; differences give the mean.

    def integral(at: Floats) -> Floats:
        n = np.floor(at).astype(np.int64)
        turn, rest = np.divmod(n, PERIOD)
        return turn * total[-1] + total[rest] + (at - n) * code[rest]

    begin = (ticks - np.asarray(first, np.float64)[..., None]) / period
    return (integral(begin + 1 / period) - integral(begin)) * period


def missing_ticks(signal: PilotSignal, symbol: float, lit: tuple[int, int]) -> Gap | None:
    """The likeliest gap; None if the pilots go on without one, or do not tell.

    A straight line is fitted to the spikes of the pilots over the values of the sequence, once with
    a gap at any place and once with a drift of the clocks instead. The residuals are taken to be
    Gaussian, so that the log likelihood ratio is ticks / 2 ln(ratio of the variances).

    Args:
        signal: spikes of the pilots.
        symbol: ticks of a symbol.
        lit: ticks in which the panel is on.
    """
    low, high = max(lit[0] - signal.first, 0), min(lit[1] - signal.first, len(signal.bits))
    total = (signal.bits @ (signal.pixels / signal.pixels.sum()))[low:high]
    count = len(total)
    if count < 8 * symbol or np.ptp(total) == 0:
        return None
    ticks = np.arange(count, dtype=np.float64)
    drift = np.arange(-_DRIFT, _DRIFT + _STEP / 2, _STEP)
    reach = np.arange(-_NEAR, _NEAR + _STEP / 2, _STEP)
    floor = _NOISE**2 * count * float(np.ptp(total)) ** 2
    without = best = np.inf
    found = None
    third = count // 3
    for begin, end in ((0, count), (0, count - third), (third, count)):
        lag, _ = sequence_peak(total[begin:end], symbol)
        near = begin - lag + reach
        # A drift about the middle: period and begin are then independent.
        for late in drift:
            codes = sequence_values(near + late / 2, symbol * (1 - late / count), ticks)
            without = min(without, float(_residual(total, codes).min()))
        for missing in range(1, _MOST + 1):
            for shift in (0, missing):  # the peak is of what follows the gap, or what precedes it
                before = sequence_values(near + shift, symbol, ticks)
                after = sequence_values(near + shift - missing, symbol, ticks)
                left = _left_by_place(total, before, after)
                if left.min() < best:
                    best, found = float(left.min()), (missing, left)
    ratio = np.log((without + floor) / (best + floor)) * count / 2
    explained = 1 - best / float(np.sum((total - total.mean()) ** 2))
    if found is None or ratio < _NATS or explained < _EXPLAINED:
        return None
    missing, left = found
    likely = np.log((left + floor) / (best + floor)) * count / 2 < _LIKELY
    first = last = int(np.argmin(left))
    while first > 1 and likely[first - 1]:
        first -= 1
    while last < count - 1 and likely[last + 1]:
        last += 1
    start = signal.first + low
    return Gap(start + first, missing, start + last)


def _residual(total: Floats, codes: Floats) -> Floats:
    """Sum of squares of (ticks,) that straight lines over (n, ticks) leave, (n,)."""
    y, x = total - total.mean(), codes - codes.mean(axis=1, keepdims=True)
    return np.asarray(y @ y - (x @ y) ** 2 / np.maximum(np.sum(x * x, axis=1), 1e-12))


def _left_by_place(total: Floats, before: Floats, after: Floats) -> Floats:
    """Sum of squares that straight lines leave over the first m ticks of `before` and the others of
    `after`, (n, ticks), by m, (ticks + 1,): of the best of n."""
    count = len(total)

    def sums(value: Floats) -> Floats:
        first, last = value
        begun = np.concatenate([np.zeros((len(first), 1)), np.cumsum(first, axis=1)], axis=1)
        ended = np.concatenate([np.zeros((len(last), 1)), np.cumsum(last, axis=1)], axis=1)
        return begun + ended[:, -1:] - ended

    y = total - total.mean()
    both = np.stack([before, after])
    spread = sums(both**2) - sums(both) ** 2 / count
    left = y @ y - sums(both * y) ** 2 / np.maximum(spread, 1e-12)
    return np.asarray(left.min(axis=0))
