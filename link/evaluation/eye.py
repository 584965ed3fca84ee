"""The eye diagram of a recording: the signal of cells over time, with all symbols superposed.

The signal is the statistic of a matched detector without memory: the spikes of the pixels of a
cell, each weighted by the cell's share of its light, summed over as many ticks as a symbol has.
This window slides past a symbol tick by tick and gives a trace. The phase of a symbol within a tick
differs from row to row and, because of the clock offset, from symbol to symbol, so the traces
sample the time between ticks. Within a trace, values between ticks are interpolated linearly.
Single ticks would resolve more, but no detector decides by half a symbol.
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

Floats = npt.NDArray[np.float64]
RARE: Final = 0.01
"""Share of the traces of each bit that may lie within the opening."""
_CELLS: Final = 600
"""Approximate number of cells, evenly spread."""
_STRETCHES, _TICKS = 6, 64
"""Number of stretches of the recording, evenly spread, and smallest length of one, ticks."""
_COLUMNS, _LEVELS = 129, 60
"""Size of the density: columns over two symbols, levels from no spike to all."""


@dataclass(frozen=True, eq=False)
class Eye:
    """An eye diagram.

    Attributes:
        x: (columns,) ticks from a symbol's middle to the window's, from one symbol before to one
            after.
        density: (levels, columns) int64, traces through each point; levels evenly from 0 (no spike)
            to 1 (all pixels in all ticks).
        low: (columns,) level exceeded by all but `RARE` of the ON traces.
        high: (columns,) level that all but `RARE` of the OFF traces stay below.
        sampled: 5 % and 95 % quantile of the ticks from the symbol's middle to that of the nearest
            window.
        height: low minus high there; below 0 if the eye is closed.
        level: mean of both.
        width: ticks around it in which low exceeds high; 0 if the eye is closed.
        traces: number of traces.
    """

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
    """Camera pixels of each cell with their weights.

    Args:
        layout, registration: cells, and their place in the image.
        cells: (cells,) indices of the cells.
        tick: instant of the registration.
        shape: (H, W) of the camera.

    Returns:
        Rows, columns and weights of the pixels, (cells, most) each, and the row of each cell's
        centre, (cells,).
    """
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
    """Weighted spikes of each cell over windows of `ticks`, (cells, windows).

    Window n begins at tick first + n. The value is 1 if every pixel spikes in every tick.

    Args:
        stream: the recording.
        first, stop: ticks to read; `first` begins a word.
        row, column, weight: (cells, most), from `_weights`.
        ticks: length of a window.
    """
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
    """Eye diagram of the data cells; None if the stream has no symbol with its neighbours.

    Args:
        stream: the recording.
        layout, registration, timing: layout, registration and timing as the receiver has estimated
            them.
        sent: (first, count) -> (count, cells), the bits that were shown.
        symbols: number of symbols of the transmission.
    """
    ticks, period = layout.mode.ticks, timing.period
    number = np.arange(0, layout.cells, max(layout.cells // _CELLS, 1))
    cells = layout.data[number]
    begin = max(float(timing.start(TRAINING, 0)), 0.0)
    length = max(_TICKS, 8 * ticks)
    room = min(stream.cycles, int(timing.start(symbols, timing.rows)) + ticks) - length
    x = np.linspace(-period, period, _COLUMNS)
    values, nearest, at_middle, bits = [], [], [], []
    done: set[int] = set()  # the stretches of a short recording overlap
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
            # Fractional number of the window centred on the symbol's middle.
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
    """Eye diagram of traces.

    Args:
        x: (columns,) ticks.
        values: (traces, columns) of all traces at x.
        nearest: (traces,) ticks from the symbol's middle to the nearest window's.
        traces: (traces,) value of that window.
        on: (traces,) bits that were sent.
    """
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
