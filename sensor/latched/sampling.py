"""Sampling instants of the rows: row by row, with comparator delay, moved by timing noise from
cycle to cycle, and by a steered clock.

Timing noise: a recording of a 400 x 250 chip has a band of some 35 rows whose intervals alternate
(6, 4): noise of the instant at which a row is sampled. It moves a spike into the neighbouring cycle
and does not accumulate, because the pixel gathers light all the time. Row r is sampled at the end
of cycle k at

    edge + offset + b(r) (jitter x(r, k) + slow(r, k)),

x standard normal. `slow` is linear between normal values KNOT cycles apart: an interval within a
stretch of it is longer or shorter by the share `wander`, RMS, and the next ones with it. b is a
raised cosine over the rows.

A steered clock moves all rows together. The light of a longer tick is gathered for longer, since
the pixels gather all the time: only the instants move, as with timing noise, which is added.

Skew and delay: the row selectors read a chip row by row (EP4340384, US12581222B2). Row r therefore
latches in cycle k the light up to edge k + 1 + skew r / H. With a comparator delay t_d, the latch
samples the charge of t_d before. Both effects move the sampling instant and lose no light, so one
offset a row describes them completely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from cosim.clock import PS, Clock
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream

Values = npt.NDArray[np.float64]
Moves = npt.NDArray[np.int64]

LIMIT: Final = 0.45
"""Largest move of a sampling instant, cycles; so the instants of a row keep their order."""
KNOT: Final = 16
"""Cycles between the values of the slow part."""
_BLOCK: Final = 64
"""Instants that are drawn at once; a multiple of KNOT."""


class RowMoves(Protocol):
    """Sampling instants of a plane's rows that move from cycle to cycle.

    Attributes:
        height: rows of the plane.
        first, stop: rows of the plane between which all that move lie.
        most: largest move of an instant, ps.
    """

    height: int
    first: int
    stop: int
    most: int

    @property
    def noisy(self) -> npt.NDArray[np.bool_]:
        """Which rows from `first` to `stop` move."""
        ...

    def moves(self, edge: int, count: int) -> npt.NDArray[np.int64]:
        """Moves of the sampling instants that begin cycles `edge` to `edge + count`, (count,
        stop - first) ps. That of instant 0, the begin of a run, and of all before, is 0."""
        ...


@dataclass(frozen=True)
class RowTiming:
    """Timing noise of the rows of a chip.

    Attributes:
        jitter: RMS of the independent part at the middle of the band, cycles.
        wander: RMS change of an interval by the slow part, relative.
        centre: middle of the band as a share of the chip's height.
        rows: full width of the band at half of its maximum.
    """

    jitter: float
    wander: float
    centre: float
    rows: float

    @property
    def slow(self) -> float:
        """RMS of the slow part at its knots, cycles: the difference of two is `wander` times the
        cycles between them."""
        return self.wander * KNOT / 2**0.5

    def profile(self, rows: npt.NDArray[np.int64], height: int) -> Values:
        """b of rows of a chip of that height: 1 in the middle of the band, 0 outside."""
        away = np.abs(rows - self.centre * (height - 1)) / self.rows
        return np.where(away < 1, np.cos(np.pi / 2 * np.minimum(away, 1)) ** 2, 0.0)

    def deviation(self, rows: npt.NDArray[np.int64], height: int) -> Values:
        """RMS of the sampling instants of rows, cycles."""
        return self.profile(rows, height) * float(np.hypot(self.jitter, self.slow))

    def on(
        self, rows: npt.NDArray[np.int64], height: int, clock: Clock, seed: int
    ) -> PlaneTiming | None:
        """The noise on a plane whose rows are these of the chip; None if none is in the band."""
        noisy = np.flatnonzero(self.profile(rows, height))
        if not noisy.size:
            return None
        return PlaneTiming(self, rows, height, clock, seed, int(noisy[0]), int(noisy[-1]) + 1)


class PlaneTiming:
    """Timing noise on the rows of a plane; see `RowMoves`."""

    def __init__(
        self,
        noise: RowTiming,
        rows: npt.NDArray[np.int64],
        height: int,
        clock: Clock,
        seed: int,
        first: int,
        stop: int,
    ) -> None:
        self.height, self.first, self.stop = rows.size, first, stop
        self._rows = rows[first:stop].astype(np.uint32)
        self._profile = noise.profile(rows[first:stop], height)
        self._noise, self._seed = noise, seed
        self._period = float(PS * clock.period)
        self.most = int(np.ceil(LIMIT * self._period))
        self._blocks: dict[int, npt.NDArray[np.int64]] = {}

    @property
    def noisy(self) -> npt.NDArray[np.bool_]:
        return self._profile > 0

    def moves(self, edge: int, count: int) -> npt.NDArray[np.int64]:
        first, last = edge // _BLOCK, (edge + count - 1) // _BLOCK + 1
        missing = [n for n in range(first, last) if n not in self._blocks]
        if missing:  # all at once, with few calls of numpy
            drawn = self._drawn(missing[0], missing[-1] + 1)
            blocks = drawn.reshape(-1, _BLOCK, self._rows.size)
            self._blocks |= {missing[0] + n: block for n, block in enumerate(blocks)}
        moves = np.concatenate([self._blocks[n] for n in range(first, last)])
        self._blocks = dict(list(self._blocks.items())[-4:])
        begin = edge - first * _BLOCK
        return moves[begin : begin + count]

    def _drawn(self, first: int, stop: int) -> npt.NDArray[np.int64]:
        """Moves of the instants of blocks, (instants, rows) ps."""
        edges = np.arange(first * _BLOCK, stop * _BLOCK)
        knots = np.arange(edges[0] // KNOT, edges[-1] // KNOT + 2)
        ends, part = self._normal(knots, 1), (edges % KNOT / KNOT)[:, None]
        at = edges // KNOT - knots[0]
        slow = ends[at] * (1 - part) + ends[at + 1] * part
        moved = self._noise.jitter * self._normal(edges, 0) + self._noise.slow * slow
        moved = np.clip(moved * self._profile, -LIMIT, LIMIT)
        moved[edges <= 0] = 0.0
        return np.rint(moved * self._period).astype(np.int64)

    def _normal(self, index: npt.NDArray[np.int64], part: int) -> Values:
        """Normal numbers, (indices, rows)."""
        counter = (self._rows[None, :], index.astype(np.uint64)[:, None] % 2**32, part, 0)
        words = philox4x32(counter, (self._seed, Stream.ROW_TIMING))[0]
        return np.asarray(ndtri((words.astype(np.float64) + 0.5) / 2.0**32))


@dataclass(frozen=True, eq=False)
class ClockMoves:
    """Moves of a clock's edges.

    Attributes:
        ps: (edges,) int64, ps by which edge k comes after that of the setting's clock; the last one
            holds for all later edges, and 0 for edge 0 and all before.
    """

    ps: Moves

    def __post_init__(self) -> None:
        if self.ps.ndim != 1 or not self.ps.size or self.ps[0] != 0:
            raise ValueError("moves of a clock must begin with 0 at edge 0")

    @property
    def most(self) -> int:
        """Largest move, ps."""
        return int(np.abs(self.ps).max())

    def at(self, edge: int, count: int) -> Moves:
        """Moves of edges `edge` to `edge + count`, (count,)."""
        return self.ps[np.clip(np.arange(edge, edge + count), 0, self.ps.size - 1)]

    def on(self, rows: int, noise: RowMoves | None) -> RowMoves:
        """Moves on a plane of `rows` rows, those of timing noise included."""
        return _Steered(self, rows, noise)


class _Steered:
    """Moves of a steered clock and of timing noise; see `RowMoves`."""

    def __init__(self, clock: ClockMoves, rows: int, noise: RowMoves | None) -> None:
        self.height, self.first, self.stop = rows, 0, rows
        self.most = clock.most + (0 if noise is None else noise.most)
        self._clock, self._noise = clock, noise

    @property
    def noisy(self) -> npt.NDArray[np.bool_]:
        return np.ones(self.height, np.bool_)

    def moves(self, edge: int, count: int) -> Moves:
        moved = np.repeat(self._clock.at(edge, count)[:, None], self.height, axis=1)
        if self._noise is not None:
            band = slice(self._noise.first, self._noise.stop)
            moved[:, band] += self._noise.moves(edge, count)
        return moved


def row_delays(clock: Clock, height: int, skew: float) -> npt.NDArray[np.float64]:
    """Delay from a latch edge to the sampling of each row of a chip, (height,) ps."""
    return np.asarray(np.arange(height) * (skew * float(PS * clock.period) / height))


def row_offsets(
    clock: Clock, height: int, skew: float, delay: float, rows: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """Offset from a latch edge to the instant at which the charge of each row is compared.

    Args:
        clock: clock of the latches.
        height: rows of the chip.
        skew: share of a cycle over which all rows are sampled, 0 to 1.
        delay: delay of the comparator in seconds, 0 to a cycle.
        rows: (first, stop) rows to return.

    Returns:
        (stop - first,) int64 ps, within a cycle of the edge.

    Raises:
        ValueError: `skew` or `delay` is out of range.
    """
    if not 0 <= skew <= 1:
        raise ValueError(f"row skew must be 0 to 1 cycle, not {skew:g}")
    if not 0 <= delay <= float(clock.period):
        raise ValueError(
            f"comparator delay must be 0 to {float(clock.period):g} s, not {delay:g} s"
        )
    offsets = row_delays(clock, height, skew)[slice(*rows)] - delay * PS
    return np.rint(offsets).astype(np.int64)
