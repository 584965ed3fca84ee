"""The result of a receiver."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import Mode
from link.receiving.watched import Watched
from link.timing import Registration, Timing
from link.verdict import Cause, Verdict


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
