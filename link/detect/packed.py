"""The joint detector with packed tables: the same evidence and chain, some ten times faster.

The joint detector computes the geometry of a cell for each symbol, and takes three log likelihoods
from a table for each pixel. Here a look-up serves a group of symbols: the pattern is that of all
their ticks, and an entry holds a word of 64 bits for each symbol, with the three log likelihoods as
whole steps in fields of 21 bits, so that additions of words add all of them. Pixels and phase are
computed once a look, a stretch of symbols in which the image and the phase move little. The chains
of bits of 32 cells are computed together in vectors. Soft values differ from those of `Joint` by
the rounding to steps, and where an image or phase within the stretch crosses the border of a class.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import by_rows
from cosim.spikes.viform import Words
from link.detect.counting import CONTEXT, PART, PHASES
from link.detect.detector import LIMIT, Soft, bits_held
from link.detect.joint import AROUND, Joint
from link.detect.packed_kernel import FIELDS, LANE, RUN, soft_values
from link.detect.tables import LEAST_CHANCE

ZERO: Final = 1 << (LANE - 1)
"""Value of a field without evidence: the middle of its range."""
_FINEST: Final = 1024
"""Largest number of steps to a unit of log likelihood."""
_MOVED: Final = 1 / 32
"""Largest movement within a look: of the image along an axis, camera pixels, and of the phase,
ticks; a quarter of a class of either. Finer looks gain no information."""
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Looks:
    """Stretches of groups of symbols for which geometry and phase are computed once.

    Attributes:
        ends: (looks,) int64, groups at which they end.
        shift: (looks, 2) float64 of the image, camera pixels, multiples of _MOVED.
        tick: (rows, looks) int64, tick in which the first symbol of a look begins; `rows` is that
            of the camera, or 1 if all rows begin together.
        phase: (rows, looks) int64, class of phase in the look's middle.
    """

    ends: Ints
    shift: npt.NDArray[np.float64]
    tick: Ints
    phase: Ints

    @property
    def begins(self) -> Ints:
        """First group of each look."""
        return np.concatenate([np.zeros(1, np.int64), self.ends[:-1]])


class Packed(Joint):
    """The joint detector with packed tables; see `Detector` and `Joint`."""

    _packed: npt.NDArray[np.uint64]
    """Packed entries of the classes `_packed_phases`, from the tables `_packed_from`."""
    _packed_from: object = None
    _packed_phases: Ints

    @property
    def group(self) -> int:
        """Symbols of a group, a power of two: patterns have at most CONTEXT + PART bits."""
        return max(PART // self.ticks, 1)

    @property
    def width(self) -> int:
        """Bits of a pattern: the ticks of a group, or of a part of a longer symbol, and CONTEXT."""
        return CONTEXT + min(self.group * self.ticks, PART)

    @property
    def steps(self) -> tuple[int, int]:
        """Steps to a unit of log likelihood, and the bias that makes all entries positive.

        The sum over a cell's pixels and parts fits in a field.
        """
        most = log((1 - LEAST_CHANCE) / LEAST_CHANCE) * min(self.ticks, PART)
        entries = self.cells.places.dx.shape[3] * self._counts.shape[2]
        scale = min(int((ZERO // entries - 1) / most), _FINEST)
        return scale, ceil(most * scale) + 1

    def entries(self, phase: Ints) -> Ints:
        """Log likelihoods of a whole symbol in classes of phase, in steps from the bias on:
        (regions, phases, parts, SHARES, patterns of PART ticks, FIELDS)."""
        scale, bias = self.steps
        steps = np.rint(self.tables()[0][:, phase, ..., 1:] * np.float32(scale))
        return steps.astype(np.int64) + bias

    def window(self, first_symbol: int, count: int) -> tuple[int, int]:
        """First symbol and the number of groups that contain `count` symbols and those around them.
        Groups begin at multiples of their length, wherever a call begins."""
        begin = (first_symbol - AROUND) // self.group * self.group
        return begin, -(-(first_symbol + count + AROUND - begin) // self.group)

    def looks(self, first_symbol: int, groups: int, rows: int) -> Looks:
        """Divides `groups` groups from a symbol on into looks, for a camera of `rows` rows."""
        first, period, slope, height = self._time
        shift = self.shifts(first_symbol, groups * self.group)[self.group // 2 :: self.group]
        # On a grid, so that soft values do not depend on where a call begins.
        shift = np.rint(shift / _MOVED) * _MOVED
        drift = abs(period - self.ticks) * self.group
        longest = max(int(_MOVED / drift), 1) if drift > 0 else groups
        last = np.append(np.any(shift[1:] != shift[:-1], axis=1), True)
        last[longest - 1 :: longest] = True
        ends = np.flatnonzero(last) + 1
        out = Looks(ends, shift[ends - 1], *np.zeros((2, 1, len(ends)), np.int64))
        half = (out.ends - out.begins) // 2 * self.group
        row = np.arange(rows if slope else 1)[:, None]
        start = first + (first_symbol + out.begins * self.group + half) * period
        start = start + slope * row / height
        tick = np.floor(start).astype(np.int64)
        phase = np.minimum(((start - tick) * PHASES).astype(np.int64), PHASES - 1)
        return Looks(out.ends, out.shift, tick - half * self.ticks, phase)

    def _table(self, phases: Ints) -> npt.NDArray[np.uint64]:
        """Entries of classes of phase, as `soft_values` reads them."""
        whole = self.tables()[0]
        known = self._packed_from is whole and np.array_equal(self._packed_phases, phases)
        if not known:
            words = np.sum(self.entries(phases) << (LANE * np.arange(FIELDS)), axis=-1)
            pattern = np.arange(1 << self.width)[:, None] >> (np.arange(self.group) * self.ticks)
            of_one = pattern & ((1 << (CONTEXT + min(self.ticks, PART))) - 1)
            packed = np.moveaxis(words[..., of_one], 1, 0).astype(np.uint64)
            self._packed = np.ascontiguousarray(packed).reshape(*packed.shape[:3], -1)
            self._packed_from, self._packed_phases = whole, phases
        return self._packed

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None, out: Soft | None = None,
    ) -> Soft:  # fmt: skip
        """See `Detector`. out: memory for the result, (count, cells) float32; None to take some."""
        cells, place, group = self.cells, self.cells.places, self.group
        begin, groups = self.window(first_symbol, count)
        looks = self.looks(begin, groups, words.shape[1])
        phases, tables_of = np.unique(looks.phase, return_inverse=True)
        stop, advance = bits_held(words, start_tick, stop_tick), group * self.ticks
        bits = looks.tick - CONTEXT - start_tick
        begins, lengths = looks.begins, looks.ends - looks.begins
        low = np.clip(-(bits // advance), 0, lengths)
        top = np.clip((stop - CONTEXT - bits) // advance, low, lengths)
        scale, bias = self.steps
        if out is None:
            out = np.empty((count, cells.x.size), np.float32)
        by_rows(
            soft_values, -(-cells.x.size // RUN), np.ascontiguousarray(words), stop, bits,
            looks.phase,
            tables_of.reshape(looks.phase.shape), begins[:, None] + np.stack([low, top], axis=-1),
            looks.ends, looks.shift, self.ticks, group, self.width, cells.region, cells.reach,
            cells.x, cells.y, place.count, place.dx, place.dy, place.share, self._table(phases),
            self.tables()[1], ZERO, bias, np.float32(1 / scale), first_symbol - begin,
            np.float32(LIMIT), out,
        )  # fmt: skip
        return out
