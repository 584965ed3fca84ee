"""Faults of single bytes on the line in both directions, and interruptions of the line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rtl_model.virtual.faults import ByteFault, Faults, Way

CUT_S = 0.15
"""Interruption by a cut, s of the board's time; longer than the board's watchdog of 0.1 s."""
POWER_UP_S = 0.2
"""Interruption by a power cycle, s of the board's time (assumed: time to configure an FPGA)."""


class Bytes(NamedTuple):
    """Bytes that are transmitted."""

    data: bytes


class Interruption(NamedTuple):
    """An interruption of the line.

    Attributes:
        seconds: its duration, s of the board's time.
        power_cycle: whether the board restarts.
    """

    seconds: float
    power_cycle: bool


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


def _bit(count: int) -> int:
    """Index of the bit to invert in byte `count`: the top three bits of Knuth's multiplicative
    hash, by which all eight are about equally frequent."""
    return (count * 2_654_435_761 & 0xFFFFFFFF) >> 29
