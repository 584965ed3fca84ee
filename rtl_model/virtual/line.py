"""Faults of the line of a virtual board: of single bytes in both directions, interruptions, and
noise that inverts any of a byte's ten bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from rtl_model.virtual.faults import ByteFault, Faults, Way

BITS = 10
"""Bits of a byte on the line: start, eight data bits, stop."""
_WORDS = 4  # of one draw
_DRAWS = -(-BITS // _WORDS)
CUT_S = 0.15
"""Interruption by a cut, s of the board's time; longer than the board's watchdog of 0.1 s."""
POWER_UP_S = 0.2
"""Interruption by a power cycle, s of the board's time (assumed: time to configure an FPGA)."""


class FaultyLine:
    """Counts the bytes in both directions and applies the faults to them."""

    def __init__(self, faults: Faults) -> None:
        self._silent = faults.silent
        self._faults: dict[Way, tuple[ByteFault, ...]] = {
            "rx": tuple(fault for fault in faults.line if fault.way == "rx"),
            "tx": tuple(fault for fault in faults.line if fault.way == "tx"),
        }
        self._count: dict[Way, int] = {"rx": 0, "tx": 0}

    def carry(self, way: Way, data: bytes) -> Iterator[Bytes | Interruption]:
        """Yields the transmitted bytes and the interruptions that `data` leads to.

        Bytes after an interruption are yielded too. The caller, which knows the time, drops them.
        """
        if way == "tx" and self._silent:
            return
        faults = self._faults[way]
        if not faults:
            self._count[way] += len(data)
            yield Bytes(data)
            return
        passed = bytearray()
        for byte in data:
            self._count[way] += 1
            count = self._count[way]
            kinds = {fault.kind for fault in faults if fault.hits(count)}
            if kinds & {"cut", "power-cycle"}:
                if passed:
                    yield Bytes(bytes(passed))
                    passed.clear()
                cycled = "power-cycle" in kinds
                yield Interruption(POWER_UP_S if cycled else CUT_S, cycled)
            if "drop" in kinds:
                continue
            if "flip" in kinds:
                byte ^= 1 << _bit(count)
            passed += bytes([byte, byte] if "extra" in kinds else [byte])
        if passed:
            yield Bytes(bytes(passed))


class Interruption(NamedTuple):
    """An interruption of the line.

    Attributes:
        seconds: its duration, s of the board's time.
        power_cycle: whether the board restarts.
    """

    seconds: float
    power_cycle: bool


def noise(share: float, seed: int, way: Way, first: int, count: int) -> npt.NDArray[np.uint16]:
    """Masks of inverted bits, (count,) uint16, start bit in bit 0.

    A bit depends only on seed, direction, number of the byte and number of the bit.

    Args:
        share: probability that a bit is inverted.
        seed: seed of the noise.
        way: direction.
        first: number of the first byte.
        count: number of bytes.
    """
    if share <= 0.0 or count == 0:
        return np.zeros(count, np.uint16)
    index = first + np.arange(count, dtype=np.uint64)
    low, high = index & np.uint64(0xFFFFFFFF), index >> np.uint64(32)
    limit = round(share * 2**32)
    masks = np.zeros(count, np.uint16)
    for draw in range(_DRAWS):
        words = philox4x32((low, high, draw, int(way == "tx")), (seed, Stream.SERIAL_NOISE))
        for place, word in enumerate(words[: BITS - _WORDS * draw]):
            hit = word.astype(np.uint64) < limit
            masks |= hit.astype(np.uint16) << np.uint16(_WORDS * draw + place)
    return masks


class Bytes(NamedTuple):
    """Bytes that are transmitted."""

    data: bytes


def _bit(count: int) -> int:
    """Index of the bit to invert in byte `count`: the top three bits of Knuth's multiplicative
    hash, by which all eight are about equally frequent."""
    return (count * 2_654_435_761 & 0xFFFFFFFF) >> 29
