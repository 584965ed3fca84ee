"""The eye diagram of a recording: what a cell shows over time, symbols laid over each other.

What is drawn is the sum that a matched detector without memory would decide by: spikes of the
pixels that see a cell, each weighted by the share of its light that is the cell's, over as many
ticks as a symbol has. As this window slides past a symbol, tick by tick, it makes a trace; where
between the camera's ticks a symbol begins differs from row to row and, by the clocks' offset, from
symbol to symbol, so traces fill the time between ticks as far as phases differ. Within a trace,
values between ticks are taken to run straight. Single ticks would be shown more finely, but as half
a symbol that nothing decides by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream
from cosim.spikes.viform import WORD, words_for
from link.detect.geometry import PLACES, cell_images
from link.layout import TRAINING, Layout
from link.timing import Registration, Timing

__all__ = ["RARE", "Eye", "open_eye"]

Floats = npt.NDArray[np.float64]
RARE: Final = 0.01
"""Share of traces of each bit that may lie within the opening."""
_CELLS: Final = 600
"""Cells looked at, about, evenly spread."""
_STRETCHES, _TICKS = 6, 64
"""Of the recording that are looked at, evenly spread, and how long one is at least."""
_COLUMNS, _LEVELS = 129, 60
"""Of the density: over two symbols, and from no spike to all."""


@dataclass(frozen=True, eq=False)
class Eye:
    """x: ticks from a symbol's middle to the window's, from one symbol before to one after,
    (columns,). density: traces through each place, (levels, columns), levels evenly from 0 (no
    spike) to 1 (all pixels in all ticks).
    low: what all but `RARE` of the cells that were on exceed, high: what all but `RARE` of those
    that were off stay below, (columns,). sampled: ticks from the symbol's middle to that of the
    window nearest to it, 5 % and 95 % quantile. height: low less high there, below 0 where the eye
    is closed. level: half-way between both. width: ticks around it in which low exceeds high, 0
    where the eye is closed. traces: how many."""

    x: Floats
    density: npt.NDArray[np.int64]
    low: Floats
    high: Floats
    sampled: tuple[float, float]
    height: float
    level: float
    width: float
    traces: int


def _weights(
    layout: Layout, registration: Registration, cells: npt.NDArray[np.intp], tick: float,
    shape: tuple[int, int],
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats, Floats]:  # fmt: skip
    """Camera rows, columns and weights of the pixels that see each cell, (cells, most) each, and
    the row of its centre, (cells,)."""
    images = cell_images(layout, registration, cells)
    dx, dy = registration.shift(tick)
    u, v = images.x + dx, images.y + dy
    x, y = np.floor(u + 0.5).astype(np.intp), np.floor(v + 0.5).astype(np.intp)
    at = (
        images.region,
        np.minimum(((v - y + 0.5) * PLACES).astype(np.intp), PLACES - 1),
        np.minimum(((u - x + 0.5) * PLACES).astype(np.intp), PLACES - 1),
    )
    places = images.places
    row, column = y[:, None] + places.dy[at], x[:, None] + places.dx[at]
    weight = places.share[at].astype(np.float64) + 0.5  # the middle of a share's class
    weight *= np.arange(row.shape[1]) < places.count[at][:, None]
    weight *= (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    row, column = (np.where(weight > 0, a, 0).astype(np.intp) for a in (row, column))
    return row, column, weight, v


def _sums(
    stream: SpikeStream, first: int, stop: int, row: npt.NDArray[np.intp],
    column: npt.NDArray[np.intp], weight: Floats, ticks: int,
) -> Floats:  # fmt: skip
    """Weighted spikes of each cell over windows of `ticks`, the n-th one from tick first + n on,
    (cells, windows), 1 where every pixel fires in every tick. first: of a word."""
    words = stream.read_words(first // WORD, words_for(stop))
    spikes = np.zeros((len(row), stop - first))
    for k in range(row.shape[1]):
        picked = np.ascontiguousarray(words[:, row[:, k], column[:, k]].T).astype("<u4", copy=False)
        bits = np.unpackbits(picked.view(np.uint8), axis=1, bitorder="little")
        spikes += weight[:, k, None] * bits[:, : stop - first]
    spikes /= np.maximum(weight.sum(axis=1), 1e-9)[:, None]
    run = np.cumsum(np.pad(spikes, ((0, 0), (1, 0))), axis=1)
    return np.asarray((run[:, ticks:] - run[:, :-ticks]) / ticks)


def open_eye(
    stream: SpikeStream, layout: Layout, registration: Registration, timing: Timing,
    sent: Callable[[int, int], npt.NDArray[np.bool_]], symbols: int,
) -> Eye | None:  # fmt: skip
    """The eye of data cells. sent: (first, count) -> (count, cells), what was shown; symbols: of
    the transmission. None where the stream holds no symbol with its neighbours."""
    ticks, period = layout.mode.ticks, timing.period
    number = np.arange(0, layout.cells, max(layout.cells // _CELLS, 1))
    cells = layout.data[number]
    begin = max(float(timing.start(TRAINING, 0)), 0.0)
    length = max(_TICKS, 8 * ticks)
    room = min(stream.cycles, int(timing.start(symbols, timing.rows)) + ticks) - length
    x = np.linspace(-period, period, _COLUMNS)
    values, nearest, at_middle, bits = [], [], [], []
    done: set[int] = set()  # stretches of a short recording overlap
    for first in sorted(
        {int(t) // WORD * WORD for t in np.linspace(begin, max(room, begin), _STRETCHES)}
    ):
        if not 0 <= first < stream.cycles:
            continue
        stop = min(first + length, stream.cycles)
        row, column, weight, v = _weights(
            layout, registration, cells, (first + stop) / 2, stream.shape
        )
        traces = _sums(stream, first, stop, row, column, weight, ticks)
        low = max(TRAINING, int(np.ceil((first - timing.first) / period)) + 2)
        high = min(symbols, int((stop - timing.first) / period) - 2)
        for symbol in range(low, high):
            # number of the window in whose middle the symbol's lies, between two of them
            where = timing.start(symbol, v) + period / 2 - ticks / 2 - first
            inside = where.min() >= period and where.max() + period <= traces.shape[1] - 1
            if symbol in done or not inside:
                continue
            done.add(symbol)
            at = where[:, None] + x
            index = np.minimum(at.astype(np.intp), traces.shape[1] - 2)
            before = np.take_along_axis(traces, index, axis=1)
            after = np.take_along_axis(traces, index + 1, axis=1)
            values.append((before + (at - index) * (after - before)).astype(np.float32))
            whole = np.rint(where).astype(np.intp)
            nearest.append(whole - where)
            at_middle.append(traces[np.arange(len(traces)), whole])
            bits.append(sent(symbol, 1)[0, number])
    if not values:
        return None
    on = np.concatenate(bits)
    if on.all() or not on.any():
        return None
    return _measured(
        x, np.concatenate(values), np.concatenate(nearest), np.concatenate(at_middle), on
    )


def _measured(
    x: Floats, values: npt.NDArray[np.float32], nearest: Floats, traces: Floats,
    on: npt.NDArray[np.bool_],
) -> Eye:  # fmt: skip
    """values: of all traces at x, (traces, columns). nearest, shown: where the windows nearest to
    the symbols' middles are, and what they hold, (traces,). on: what was sent, (traces,)."""
    level = np.clip((values * _LEVELS).astype(np.intp), 0, _LEVELS - 1)
    density = np.zeros((_LEVELS, x.size), np.int64)
    for n in range(x.size):
        density[:, n] = np.bincount(level[:, n], minlength=_LEVELS)
    low = np.asarray(np.quantile(values[on], RARE, axis=0), np.float64)
    high = np.asarray(np.quantile(values[~on], 1 - RARE, axis=0), np.float64)
    top, bottom = float(np.quantile(traces[on], RARE)), float(np.quantile(traces[~on], 1 - RARE))
    left, right = (float(q) for q in np.quantile(nearest, (0.05, 0.95)))
    middle = int(np.argmin(np.abs(x - (left + right) / 2)))
    width = 0.0
    if top > bottom and low[middle] > high[middle]:
        shut = np.flatnonzero(low <= high)
        before, after = shut[shut < middle], shut[shut > middle]
        ends = (before[-1] if before.size else 0, after[0] if after.size else x.size - 1)
        width = float(x[ends[1]] - x[ends[0]])
    return Eye(
        x, density, low, high, (left, right), top - bottom, (top + bottom) / 2, width, len(on)
    )
