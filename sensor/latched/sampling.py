"""Sampling instants of the rows: row by row, with comparator delay, and by a steered clock; and
timing noise of the pixels in a band of rows.

Timing noise: a recording of a 400 x 250 chip has a band of some 35 rows whose intervals alternate
(6, 4): noise of the instant at which a pixel is compared. It moves a spike into the neighbouring
cycle and does not accumulate, because the pixel gathers light all the time. It is independent from
pixel to pixel: the counts of the band's rows vary as those of independent pixels. Pixel p of row r
is compared at the end of cycle k at

    edge + offset + m(p, k),    m = b(r) (jitter x(p, k) + slow(p, k)),

x standard normal. `slow` is linear between normal values KNOT cycles apart: an interval within a
stretch of it is longer or shorter by the share `wander`, RMS, and the next ones with it. b is a
raised cosine over the rows. In the reference tier a pixel is latched at that instant. The other
tiers compare the charge at the edge, and m times the charge of the cycle that it ends: the light
between edge and instant is taken as that of the cycle. The difference is of second order in the
change of light, and does not accumulate either.

A normal number is made of a 32-bit hash of pixel and cycle: the sum of its four bytes, stretched by
a cubic (Cornish and Fisher, Rev. Inst. Int. Stat. 5, 1938) to the tails of a normal law. Its
distribution function is normal within .0007 at the middle of its steps. It takes few instructions,
which every tier repeats bit for bit.

A steered clock moves all rows together. The light of a longer tick is gathered for longer, since
the pixels gather all the time: only the instants move.

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

from cosim.clock import PS, Clock
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.pixel.bank import GENERATOR, WEYL, scrambled

Values = npt.NDArray[np.float64]
Moves = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]

MOST_JITTER: Final = 0.2
"""Largest timing noise, RMS, cycles; LIMIT is more than twice as large."""
LIMIT: Final = 0.45
"""Largest move of a sampling instant, cycles; so the instants of a pixel keep their order."""
KNOT: Final = 16
"""Cycles between the values of the slow part."""
_BEND: Final = 0.016
"""Cubic part of a normal number, over the sum of bytes in standard deviations: the value at which
the distribution function comes closest to that of a normal law."""


def _cubic() -> tuple[np.float32, np.float32]:
    """Factors of x and of x^3 for a normal number of variance 1; x: sum of four bytes - 510."""
    byte = np.full(256, 1 / 256)
    pair = np.convolve(byte, byte)
    share, x = np.convolve(pair, pair), np.arange(-510, 511)
    variance = float(share @ x**2)
    bent = x * (1 + _BEND / variance * x**2)
    factor = float(share @ bent**2) ** -0.5
    return np.float32(factor), np.float32(factor * _BEND / variance)


_CUBIC: Final = _cubic()
_MOST: Final = float(510 * (_CUBIC[0] + _CUBIC[1] * np.float32(510**2)))
"""Largest normal number."""


def _normal(word: npt.NDArray[np.uint32], factor: Floats, cubic: Floats) -> Floats:
    """Sums x of the bytes of random words, less 510, as factor x + cubic x^3."""
    pairs = (word & np.uint32(0xFF00FF)) + ((word >> np.uint32(8)) & np.uint32(0xFF00FF))
    x = ((pairs & np.uint32(0xFFFF)) + (pairs >> np.uint32(16))).astype(np.float32)
    x -= np.float32(510)
    return x * (factor + cubic * (x * x))


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

    def moves(self, edge: int, count: int) -> npt.NDArray[np.int64]:
        """Moves of the sampling instants that begin cycles `edge` to `edge + count`, (count,
        stop - first) ps. That of instant 0, the begin of a run, and of all before, is 0."""
        ...


@dataclass(frozen=True)
class RowTiming:
    """Timing noise of the pixels in a band of rows.

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
        """RMS of the sampling instants of the pixels of rows, cycles."""
        return self.profile(rows, height) * float(np.hypot(self.jitter, self.slow))

    def on(
        self, numbers: npt.NDArray[np.uint32], rows: npt.NDArray[np.int64], height: int, seed: int
    ) -> PixelTiming | None:
        """The noise on a plane; None if no row of it is in the band.

        Args:
            numbers: (pixels,) numbers of the plane's pixels on the chip, row by row.
            rows: (rows,) row of the chip of each row of the plane.
            height: rows of the chip.
            seed: seed of the run.
        """
        noisy = np.flatnonzero(self.profile(rows, height))
        if not noisy.size:
            return None
        first, stop = int(noisy[0]), int(noisy[-1]) + 1
        profile = self.profile(rows[first:stop], height)[:, None]
        mine = numbers.reshape(rows.size, -1)[first:stop]
        deviations = (profile * (self.jitter, self.slow)).astype(np.float32)
        return PixelTiming(first, stop, deviations, mine, seed)


class PixelTiming:
    """Timing noise of the pixels of a plane.

    Args:
        first, stop: rows of the plane between which all that have it lie.
        deviations: (rows, 2) float32, RMS of the independent and of the slow part at its knots of
            these rows, cycles.
        numbers: (rows, columns) uint32, numbers of their pixels on the chip.
        seed: seed of the run.

    Attributes:
        columns: columns of the plane.
        noisy: (rows,) bool, which of the rows have it.
        key: hash of the seed, below 2^32.
        factors: (rows, 5) float32, factors of x and of x^3 of the independent part, the same of the
            slow part at its knots, and the largest move, cycles.
    """

    def __init__(
        self, first: int, stop: int, deviations: Floats, numbers: npt.NDArray[np.uint32], seed: int
    ) -> None:
        self.first, self.stop = first, stop
        self.columns = numbers.shape[1]
        self.noisy = deviations.any(axis=1)
        self.key = int(philox4x32((0, 0, 0, 0), (seed, Stream.ROW_TIMING))[0])
        most = np.minimum(np.float32(LIMIT), np.float32(_MOST) * deviations.sum(axis=1))
        parts = [deviation * part for deviation in deviations.T for part in _CUBIC]
        self.factors = np.stack([*parts, most], axis=1)
        self._own = scrambled(numbers.astype(np.uint32) ^ np.uint32(self.key))
        self._knots: dict[int, Floats] = {}

    def at(self, edge: int) -> Floats:
        """Moves of the instants that end cycle edge - 1, (rows, columns) float32, cycles. That of
        instant 0, the begin of a run, is 0."""
        if edge <= 0:
            return np.zeros(self._own.shape, np.float32)
        knot, part = divmod(edge, KNOT)
        low, high = self._knot(knot), self._knot(knot + 1)
        self._knots = {n: self._knots[n] for n in (knot, knot + 1)}
        slow = low + (high - low) * np.float32(1 / KNOT) * np.float32(part)
        moved = self._drawn(2 * edge, 0) + slow
        return np.clip(moved, np.float32(-LIMIT), np.float32(LIMIT))

    def _knot(self, knot: int) -> Floats:
        """The slow part at a knot."""
        if knot not in self._knots:
            self._knots[knot] = self._drawn(2 * knot + 1, 2)
        return self._knots[knot]

    def _drawn(self, draw: int, column: int) -> Floats:
        """Normal numbers of the pixels, (rows, columns), of a draw's number, by the `factors` from
        a column on."""
        first, second = GENERATOR["FACTOR_1"], GENERATOR["FACTOR_2"]
        with np.errstate(over="ignore"):
            word = scrambled(np.array([draw % 2**32], np.uint32) * np.uint32(WEYL))
            # `scrambled`, whose first step two hashes do not need.
            word = (self._own ^ word) * np.uint32(first)
            word = (word ^ (word >> np.uint32(GENERATOR["SHIFT_2"]))) * np.uint32(second)
        factor, cubic = (
            self.factors[:, column : column + 1],
            self.factors[:, column + 1 : column + 2],
        )
        return _normal(word ^ (word >> np.uint32(16)), factor, cubic)


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

    def on(self, rows: int) -> RowMoves:
        """Moves on a plane of `rows` rows."""
        return _Steered(self, rows)


class _Steered:
    """Moves of a steered clock; see `RowMoves`."""

    def __init__(self, clock: ClockMoves, rows: int) -> None:
        self.height, self.first, self.stop = rows, 0, rows
        self.most, self._clock = clock.most, clock

    def moves(self, edge: int, count: int) -> Moves:
        return np.repeat(self._clock.at(edge, count)[:, None], self.height, axis=1)


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
