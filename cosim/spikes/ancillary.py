"""Ancillary data of a spike stream: what a chip says beyond its spikes, in the cycle it holds from.

A write to a register changes the light of a spike (the threshold) and the rows that are read. A
plane of charges has the light of the pixels that did not fire in a span of cycles, in levels of a
threshold. Both are self-contained: what follows a stream needs no earlier one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import Words, cut_words

_WRITE: Final = "write"
_CHARGE: Final = "charge"


@dataclass(frozen=True)
class RegisterWrite:
    """Registers of a chip from a cycle on.

    Attributes:
        cycle: first cycle for which they hold.
        packet: light of a spike, of one at the stream's nominal threshold.
        rows: (first, stop) rows that are read; the others are dark.
        lasting: whether it holds until the next one.
    """

    lasting: ClassVar = True
    cycle: int
    packet: float
    rows: tuple[int, int]

    def part(self, rows: tuple[int, int], columns: tuple[int, int]) -> RegisterWrite:
        """The same of a part of the pixels; rows that are not read in it are an empty range."""
        top, bottom = (min(max(row, rows[0]), rows[1]) - rows[0] for row in self.rows)
        return replace(self, rows=(top, bottom))


@dataclass(frozen=True, eq=False)
class ChargePlane:
    """Light of the pixels that did not fire in a span of cycles.

    Attributes:
        cycle: first cycle after the span.
        span: cycles of the span.
        gain: levels that each pixel has gathered in the span, 0 where it fired, (H, W) uint16.
        levels: levels of a threshold.
        lasting: whether it holds until the next one.
    """

    lasting: ClassVar = False
    cycle: int
    span: int
    gain: npt.NDArray[np.uint16]
    levels: int

    def part(self, rows: tuple[int, int], columns: tuple[int, int]) -> ChargePlane:
        """The same of a part of the pixels, each range (first, stop)."""
        return replace(self, gain=self.gain[slice(*rows), slice(*columns)])


Ancillary = RegisterWrite | ChargePlane


def cuts(
    words: Words, cycles: int, first: int, pending: Sequence[Ancillary]
) -> Iterator[tuple[Words, int, int, tuple[Ancillary, ...]]]:
    """Parts of a block between ancillary data: their words from bit 0 on, first cycle, number of
    cycles, and what precedes them.

    Args:
        words: (ceil(cycles / 32), ...) uint32.
        cycles, first: number of cycles, and the first one.
        pending: data of the block, in the order of their cycles.
    """
    at = sorted({first, *(each.cycle for each in pending)})
    for begin, end in zip(at, [*at[1:], first + cycles], strict=True):
        before = tuple(each for each in pending if each.cycle == begin)
        yield cut_words(words, begin - first, end - first), begin, end - begin, before


def to_arrays(several: Iterable[Ancillary]) -> dict[str, npt.NDArray[Any]]:
    """Ancillary data as arrays by name, for states and files."""
    arrays: dict[str, npt.NDArray[Any]] = {}
    for n, each in enumerate(several):
        if isinstance(each, RegisterWrite):
            arrays[f"{_WRITE}/{n:06d}"] = np.array([each.cycle, each.packet, *each.rows])
        else:
            name = f"{_CHARGE}/{n:06d}/{each.cycle}/{each.span}/{each.levels}"
            arrays[name] = each.gain
    return arrays


def from_arrays(arrays: dict[str, npt.NDArray[Any]]) -> tuple[Ancillary, ...]:
    """Ancillary data from `to_arrays`, in their order."""
    found: list[tuple[str, Ancillary]] = []
    for name, values in arrays.items():
        kind, number, *rest = name.split("/")
        if kind == _WRITE:
            cycle, packet, first, stop = (float(x) for x in values)
            rows = (int(first), int(stop))
            found.append((number, RegisterWrite(int(cycle), packet, rows)))
        else:
            at, span, levels = map(int, rest)
            found.append((number, ChargePlane(at, span, np.array(values, np.uint16), levels)))
    return tuple(each for _, each in sorted(found, key=lambda item: item[0]))
