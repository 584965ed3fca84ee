"""The sequence of the pilots in a signal: its begin and its clock."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import PERIOD, pilots

Floats = npt.NDArray[np.float64]
_PHASES: Final = 4
"""Steps of a tick in the search for the sequence."""
_SHOWS: Final = 0.4
"""Correlation from which a quarter of a section shows the same sequence."""


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


def shows_sequence(total: Floats, nominal: float, a: int, b: int, first: float) -> bool:
    """Whether ticks a to b show the sequence that begins at tick `first`."""
    code = sequence_values(np.array(first), nominal, np.arange(a, b, dtype=np.float64))
    if b - a < 8 or np.ptp(code) == 0 or np.ptp(total[a:b]) == 0:
        return False
    return float(np.corrcoef(code, total[a:b])[0, 1]) > _SHOWS


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
