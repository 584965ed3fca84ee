"""What a receiver hands back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import Mode
from link.timing import Registration, Timing
from link.verdict import Cause, Verdict

__all__ = ["Instant", "Received"]


@dataclass(frozen=True)
class Instant:
    """A group: its number, the tick at which its last row was latched, and right frames it brought
    (those of a block that several groups fill come with the last of them)."""

    group: int
    tick: int
    right: int


@dataclass(frozen=True, eq=False)
class Received:
    """delivered: (bytes, name) of the file, only when whole. verdict: why, or why not. Of frames
    and codewords: how many were seen, right, needed (None: not known), could not be mended, and
    bytes mended. instants: of each group decoded, in order. delivered_tick: when the file was
    whole. first_light: tick at which symbol 0 began for row 0, before the stream's own first one
    where that begins within the training; None where it begins later. clock_error: parts per
    million by which the timing's period may be off, an estimate. cell_quality: mean size of the
    soft values, nats, (rows, columns) float32, 0 where no data are. cell_errors: bytes mended at
    each cell, (rows, columns). promise: mean of 1 / (1 + exp |soft|) over all soft values, the
    error rate that they let expect; None without any. soft: a sample of them, (n,) float32, soft_at
    their (symbol, data cell), (n, 2). ticks: of the stream. score: of the pilots' sequence,
    standard deviations. on, background: thresholds a tick, None where not measured."""

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
    cell_quality: npt.NDArray[np.float32] | None = None
    cell_errors: npt.NDArray[np.int64] | None = None
    soft: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    soft_at: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    promise: float | None = None
    packed: dict[int, npt.NDArray[np.uint8]] = field(default_factory=dict, repr=False)

    @property
    def whole(self) -> bool:
        return self.verdict.cause is Cause.NONE

    @property
    def layout(self) -> Layout | None:
        return Layout(self.mode) if self.mode is not None else None

    def decided(self, first: int, count: int) -> npt.NDArray[np.bool_]:
        """What the detector made of symbols, (count, cells) of data cells, before any code; raises
        KeyError for symbols that were not decoded or are no longer held."""
        layout = self.layout
        if layout is None:
            raise KeyError(first)
        rows = [np.unpackbits(self.packed[first + n])[: layout.cells] for n in range(count)]
        return np.array(rows, np.bool_).reshape(count, layout.cells)
