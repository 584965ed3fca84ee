"""Faults of single bytes on the line, both ways, and the time in which it carries nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rtl_model.virtual.faults import ByteFault, Faults, Way

__all__ = ["CUT_S", "POWER_UP_S", "Bytes", "Dead", "FaultyLine"]

CUT_S = 0.15
"""How long a cut line carries nothing: longer than the board's watchdog of 0.1 s, in its time."""
POWER_UP_S = 0.2
"""How long a board says and hears nothing when its power was cycled (assumed: an FPGA loads its
configuration), in its time."""


class Bytes(NamedTuple):
    """Bytes that go on."""

    data: bytes


class Dead(NamedTuple):
    """From here on the line carries nothing for `seconds`, and the board may start anew."""

    seconds: float
    power_cycle: bool


class FaultyLine:
    """Counts bytes both ways and does to them what the faults say."""

    def __init__(self, faults: Faults) -> None:
        self._silent = faults.silent
        self._faults: dict[Way, tuple[ByteFault, ...]] = {
            "rx": tuple(fault for fault in faults.line if fault.way == "rx"),
            "tx": tuple(fault for fault in faults.line if fault.way == "tx"),
        }
        self._count: dict[Way, int] = {"rx": 0, "tx": 0}

    def carry(self, way: Way, data: bytes) -> Iterator[Bytes | Dead]:
        """Yields what becomes of `data`. Bytes after a Dead are yielded too; whoever keeps time
        loses them."""
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
                yield Dead(POWER_UP_S if cycled else CUT_S, cycled)
            if "drop" in kinds:
                continue
            if "flip" in kinds:
                byte ^= 1 << _bit(count)
            passed += bytes([byte, byte] if "extra" in kinds else [byte])
        if passed:
            yield Bytes(bytes(passed))


def _bit(count: int) -> int:
    """Returns which bit of byte `count` is turned over: the top three bits of Knuth's
    multiplicative hash, so that all eight come about as often."""
    return (count * 2_654_435_761 & 0xFFFFFFFF) >> 29
