"""What a latched chip says beyond its spikes, in its stream: writes to its registers, the light of
pixels that do not fire, and the spikes that it rejects as dark (Huang 2022, 4.4 and 4.5).

An interval of `dark` cycles or more is dark current's, so the spike that ends it is left out. The
first interval of a pixel is counted from the start of the stream. A plane of charges is the
difference of two readings. Its pixels are dark where the light is below that of a rejected
interval.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.ancillary import Ancillary, ChargePlane, RegisterWrite
from cosim.spikes.viform import WORD, Viform, cut_words
from cosim.stage import Block, State
from sensor.latched.writes import Phase, Registers

MOST_DARK: Final = 2**24
"""Cycles up to which a display knows the age of a pixel; no run shows a longer interval."""


@njit(cache=True, nogil=True)
def _reject(words, cycles, dark, age, out):  # type: ignore[no-untyped-def]
    """Copies words without the spikes whose interval is `dark` cycles or more. age: cycles since
    the last spike of each pixel, or the start, (n,), updated."""
    for pixel in range(words.shape[1]):
        old = age[pixel]
        for first in range(0, cycles, WORD):
            word = words[first // WORD, pixel]
            count = min(WORD, cycles - first)
            if not word:
                old += count
                continue
            kept = word
            if old + count < dark:  # no interval of these cycles is as long
                out[first // WORD, pixel] = word
                old = 0
                while not (word >> np.uint32(count - 1 - old)) & np.uint32(1):
                    old += 1
                continue
            for n in range(count):
                old += 1
                if (word >> np.uint32(n)) & np.uint32(1):
                    if old >= dark:
                        kept &= ~(np.uint32(1) << np.uint32(n))
                    old = 0
            out[first // WORD, pixel] = kept
        age[pixel] = old


class Charges(Protocol):
    """Readings of the charge of a stream.

    Attributes:
        every: cycles between two readings, the first of which precedes the stream.
        levels: levels of a threshold.
    """

    @property
    def every(self) -> int: ...
    @property
    def levels(self) -> int: ...
    def gain(self, number: int) -> npt.NDArray[np.int64]:
        """Levels from reading `number` - 1 to reading `number`, (H, W), 0 or more."""
        ...


def writes_of(phases: Sequence[Phase], threshold: float, height: int) -> tuple[RegisterWrite, ...]:
    """The writes of a run, without registers that are nominal from the first cycle on.

    Args:
        phases: the registers between the writes.
        threshold: nominal threshold, electrons, whose spike is one packet.
        height: rows of the chip.
    """
    nominal = RegisterWrite(0, 1.0, (0, height))
    writes = [RegisterWrite(p.start, p.threshold / threshold, p.window) for p in phases]
    return tuple(write for write in writes if write != nominal)


def registers_of(several: Iterable[Ancillary], height: int, start: int = 0) -> Registers | None:
    """Thresholds and windows of a stream, relative to its nominal threshold; None without writes.

    Args:
        several: what its source says.
        height: rows of the stream.
        start: number of its first cycle; those of the registers count from it.
    """
    writes = [each for each in several if isinstance(each, RegisterWrite)]
    phases = [Phase(each.cycle - start, each.packet, each.rows) for each in writes]
    if not phases:
        return None
    first = [] if phases[0].start == 0 else [Phase(0, 1.0, (0, height))]
    return Registers((*first, *phases), 1.0, height)


class AncillaryStage:
    """Adds to the blocks of a chip's stream what it says beyond the spikes.

    Args:
        shape: (height, width) of the stream.
        phases: the registers between the writes.
        threshold: nominal threshold, electrons, whose spike is one packet.
        charges: readings of the charge; None without any.
        dark: cycles from which on an interval is rejected; infinite for none.

    Attributes:
        rejected: spikes that were left out so far.
    """

    def __init__(
        self, shape: tuple[int, int], phases: Sequence[Phase], threshold: float,
        charges: Charges | None, dark: float,
    ) -> None:  # fmt: skip
        self._charges, self._dark = charges, dark
        self._writes = writes_of(phases, threshold, shape[0])
        self._age = np.zeros(shape if np.isfinite(dark) else (0, 0), np.int64)
        self._fired = np.zeros(shape if charges is not None else (0, 0), np.bool_)
        self.rejected = 0

    def step(self, data: Viform, block: Block) -> Viform:
        """The planes of one block with what belongs to them."""
        told: list[Ancillary] = [w for w in self._writes if block.start <= w.cycle < block.stop]
        if self._charges is not None:
            told += self._planes(self._charges, data, block)
        if self._age.size:
            data = self._without_dark(data)
        return replace(data, ancillary=tuple(told)) if told else data

    def _planes(self, charges: Charges, data: Viform, block: Block) -> list[ChargePlane]:
        """Planes of the charges that were read at cycles of the block."""
        every, at, told = charges.every, block.start, list[ChargePlane]()
        for cycle in range(-(-block.start // every) * every, block.stop, every):
            self._note(data, at - block.start, cycle - block.start)
            if cycle:
                gain, at = charges.gain(cycle // every), cycle
                least = charges.levels * every / self._dark  # levels of a rejected interval
                seen = np.where(~self._fired & (gain > least), gain, 0).astype(np.uint16)
                told.append(ChargePlane(cycle, every, seen, charges.levels))
            self._fired[:] = False
        self._note(data, at - block.start, block.cycles)
        return told

    def _note(self, data: Viform, first: int, stop: int) -> None:
        """Takes down which pixels fire in cycles of a block."""
        if stop > first:
            self._fired |= cut_words(data.words, first, stop).any(axis=0)

    def _without_dark(self, data: Viform) -> Viform:
        words = data.words.reshape(len(data.words), -1)
        out = np.zeros_like(words)
        _reject(words, data.cycles, self._dark, self._age.reshape(-1), out)
        left = np.bitwise_count(words).sum(dtype=np.int64)
        self.rejected += int(left - np.bitwise_count(out).sum(dtype=np.int64))
        return replace(data, words=out.reshape(data.words.shape))

    def state(self) -> State:
        """Everything that the next block depends on."""
        return {
            "age": self._age.copy(), "fired": self._fired.copy(),
            "rejected": np.array(self.rejected),
        }  # fmt: skip

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._age, self._fired = state["age"].copy(), state["fired"].copy()
        self.rejected = int(state["rejected"])
