"""The result of a receiver, with soft values of some cells and a sample of all.

All soft values of a recording are too many to store: a megapixel panel gives a million with every
symbol. Watched are cells of a lattice over the panel, which stand for all, and the least certain
cells of the first symbols, which are those that fail.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import Mode
from link.timing import Registration, Timing
from link.verdict import Cause, Verdict

CELLS: Final = 2000
"""Cells of each of the two sets, at most."""
VALUES: Final = 2_000_000
"""Soft values that are stored, at most: those of the first symbols."""
_SAMPLED: Final = 65_536
_SAMPLES: Final = 800_000
"""Largest number of soft values of a sample: _SAMPLED of a chunk, and about _SAMPLES of all."""


@dataclass(frozen=True, eq=False)
class Received:
    """The result of a receiver. None stands for an unknown value.

    Attributes:
        verdict: cause of success or failure.
        ticks: number of ticks of the stream.
        delivered: (bytes, name) of the file, only if whole.
        mode, registration, timing: mode, registration and timing of the transmission.
        clock_error: largest plausible error of the timing's period, parts per million.
        first_light: tick at which symbol 0 began in row 0, possibly before the stream's first one;
            None if the recording begins after the training.
        on, background: charge of a tick, thresholds.
        score: score of the pilots' sequence, standard deviations.
        instants: instant of each decoded group, in order.
        delivered_tick: tick at which the file was whole.
        frames_read, frames_right, frames_needed: numbers of frames.
        codewords, codewords_wrong: codewords read, and those that could not be corrected.
        bytes_corrected: bytes corrected.
        rounds: rounds of decoding in all codewords; 0 for a code without rounds.
        cell_quality: (rows, columns) float32, mean magnitude of the soft values, nats; 0 without
            data.
        cell_errors: (rows, columns) int64, bytes corrected at each cell; bits of a code of bits.
        soft: (n,) float32, a sample of the soft values.
        soft_at: (n, 2) int64, their symbol and data cell.
        promise: mean of 1 / (1 + exp |soft|) over all soft values, the error rate that they
            predict.
        packed: decisions of the last symbols, packed bits.
        watched: soft values of some cells over the symbols.
    """

    verdict: Verdict
    ticks: int
    delivered: tuple[bytes, str] | None = None
    mode: Mode | None = None
    registration: Registration | None = None
    timing: Timing | None = None
    clock_error: float | None = None
    first_light: int | None = None
    on: float | None = None
    background: float | None = None
    score: float = 0.0
    instants: tuple[Instant, ...] = ()
    delivered_tick: int | None = None
    frames_read: int = 0
    frames_right: int = 0
    frames_needed: int | None = None
    codewords: int = 0
    codewords_wrong: int = 0
    bytes_corrected: int = 0
    rounds: int = 0
    cell_quality: npt.NDArray[np.float32] | None = None
    cell_errors: npt.NDArray[np.int64] | None = None
    soft: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    soft_at: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    promise: float | None = None
    packed: dict[int, npt.NDArray[np.uint8]] = field(default_factory=dict, repr=False)
    watched: Watched | None = field(default=None, repr=False)

    @property
    def whole(self) -> bool:
        return self.verdict.cause is Cause.NONE

    @property
    def layout(self) -> Layout | None:
        return Layout(self.mode) if self.mode is not None else None

    def decided(self, first: int, count: int) -> npt.NDArray[np.bool_]:
        """Detector's decisions on symbols before any code, (count, cells) of data cells.

        Raises:
            KeyError: for symbols that were not decoded or are no longer stored.
        """
        layout = self.layout
        if layout is None:
            raise KeyError(first)
        rows = [np.unpackbits(self.packed[first + n])[: layout.cells] for n in range(count)]
        return np.array(rows, np.bool_).reshape(count, layout.cells)


@dataclass(frozen=True)
class Instant:
    """A decoded group.

    Attributes:
        group: its number.
        tick: tick at which its last row was latched.
        right: correct frames completed by it (those of a block of several groups come with the last
            of them).
        frames: number of frames that its block was read as, correct or not.
    """

    group: int
    tick: int
    right: int
    frames: int


class SoftSample:
    """A sample of soft values, evenly from the first symbols."""

    def __init__(self) -> None:
        self._soft: list[npt.NDArray[np.float32]] = []
        self._at: list[npt.NDArray[np.int64]] = []

    def add(self, first: int, soft: npt.NDArray[np.float32]) -> None:
        """Takes some of the soft values, (symbols, cells), of symbols from `first` on."""
        if sum(len(part) for part in self._soft) < _SAMPLES:
            stride = max(1, soft.size // _SAMPLED) | 1  # odd, so that it samples all symbols
            picked = np.arange(0, soft.size, stride)
            of, cell = np.divmod(picked, soft.shape[1])
            self._soft.append(soft.ravel()[picked])
            self._at.append(np.stack([of + first, cell], 1).astype(np.int64))

    @property
    def soft(self) -> npt.NDArray[np.float32]:
        """(n,) soft values."""
        return np.concatenate([np.zeros(0, np.float32), *self._soft])

    @property
    def at(self) -> npt.NDArray[np.int64]:
        """(n, 2) symbol and data cell of each."""
        return np.concatenate([np.zeros((0, 2), np.int64), *self._at])


@dataclass(frozen=True, eq=False)
class Watched:
    """Soft values of some cells.

    Attributes:
        cells: (n,) data cells, ascending.
        symbols: (m,) numbers of the symbols, ascending; with gaps where some were not read.
        soft: (m, n) float16, ln P(spikes | on) - ln P(spikes | off).
    """

    cells: npt.NDArray[np.intp]
    symbols: npt.NDArray[np.int64]
    soft: npt.NDArray[np.float16]


class Watcher:
    """Collects the soft values of some cells, chosen at the first symbols."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._cells: npt.NDArray[np.intp] | None = None
        self._parts: list[tuple[int, npt.NDArray[np.float16]]] = []

    def add(self, first: int, soft: npt.NDArray[np.float32]) -> None:
        """Takes the soft values of consecutive symbols from `first` on, (symbols, cells)."""
        if not len(soft):
            return
        if self._cells is None:
            fewest = min(CELLS, soft.shape[1])
            certain = np.abs(soft).mean(axis=0)
            least = np.argpartition(certain, fewest - 1)[:fewest]
            self._cells = np.union1d(_lattice(self._layout), least)
        left = VALUES // self._cells.size - sum(len(part) for _, part in self._parts)
        if left > 0:
            self._parts.append((first, soft[:left, self._cells].astype(np.float16)))

    def result(self) -> Watched | None:
        """What was collected; None without a symbol. A symbol that was read twice, before and
        after an interruption, counts as it was read last."""
        if self._cells is None:
            return None
        last = {
            first + n: row for first, part in self._parts for n, row in enumerate(part)
        }  # fmt: skip
        symbols = sorted(last)
        return Watched(
            self._cells, np.array(symbols, np.int64), np.stack([last[n] for n in symbols])
        )


def _lattice(layout: Layout) -> npt.NDArray[np.intp]:
    """Data cells at every n-th row and column, at most `CELLS`."""
    rows, columns = layout.shape
    step = int(np.ceil(np.sqrt(rows * columns / CELLS)))
    row, column = np.divmod(layout.data, columns)
    on = (row % step == step // 2) & (column % step == step // 2)
    return np.flatnonzero(on)[:CELLS]
