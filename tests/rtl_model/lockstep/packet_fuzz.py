"""Fuzz at byte level: random packets into the Verilog's core and into the cycle model's bridge.

A packet is valid, cut short, bent, or noise, and pauses lie in it and after it, some of which end
within some clocks of the watchdog's time. After every piece both sides must have said the same, and
be at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import NamedTuple

import numpy as np

from rtl_model.cycle import Bridge, System
from rtl_model.geometry import Geometry
from rtl_model.lockstep.program import ADDRESS
from rtl_model.registers import MEMORIES, REGISTERS
from rtl_model.verilated import build_crc
from rtl_model.virtual.faults import Faults
from rtl_model.virtual.simulators import Simulator, make_simulator

FUZZED = Geometry(4, 32, 32, clock_hz=8000, baud=1000, capture_words=64, sink_words=16)
"""The build, with a short watchdog of 800 clocks."""

_PATIENCE = FUZZED.clock_hz // 10
_LONGEST = 16 * _PATIENCE  # clocks in which any answer has ended, cut by the watchdog or not
_COUNTERS = bytes([2, 9]) + (ADDRESS["uart_rx_bytes"] // 4).to_bytes(4, "big")
_REST = [
    bytes([1, 1]) + (ADDRESS[name] // 4).to_bytes(4, "big") + bytes(4)
    for name in ("capture_arm", "sink_run")
]


def _attending(system: System) -> bool:
    """Whether a burst or a plane of the sink is pending or in progress."""
    sink, capture = system._sink, system._capture
    return capture.armed or capture.busy or sink.left > 0 or sink.active


class Fuzz(NamedTuple):
    """Result of a run.

    `counters` are the nine registers from uart_rx_bytes on. `failure` is the difference in one
    line, "" if there is none.
    """

    packets: int
    sent: int
    answered: int
    clock: int
    counters: tuple[int, ...]
    failure: str


def fuzz(packets: int, *, seed: int = 0, progress: Callable[[int], None] | None = None) -> Fuzz:
    """Sends `packets` random packets to both, and reads the counters after every 50th.

    Raises InputError where Verilator is missing.
    """
    with closing(make_simulator("bytes", FUZZED, Faults())) as verilog:
        system = System(FUZZED, build=build_crc(FUZZED), keep=False)
        model = Bridge(system=system, byte_clocks=1)
        pair = _Pair(verilog, model)
        rng = np.random.default_rng((seed, 1))
        counters: tuple[int, ...] = ()
        done = 0
        while done < packets and not pair.failure:
            _send(pair, rng)
            done += 1
            if _attending(system) and rng.random() < 0.5:
                pair.silence(_PATIENCE + 1)
                for packet in _REST:
                    pair.send(packet)
            if done % 50 == 0 or done == packets:
                pair.silence(_PATIENCE + 1)
                answer = pair.send(_COUNTERS)
                counters = tuple(
                    int.from_bytes(answer[n : n + 4], "big") for n in range(0, len(answer), 4)
                )
                if len(counters) != _COUNTERS[1] and not pair.failure:
                    pair.failure = f"clock {verilog.clock}: no counters after {done} packets"
                if progress is not None:
                    progress(done)
        failure = pair.failure and f"{pair.failure}; packet {done} of seed {seed}"
        return Fuzz(done, pair.sent, pair.answered, verilog.clock, counters, failure)


class _Pair:
    """Both sides of the comparison, at the same clock."""

    def __init__(self, verilog: Simulator, model: Bridge) -> None:
        self.verilog, self.model = verilog, model
        self.sent = self.answered = 0
        self.began = 0  # when the last packet did
        self.failure = ""

    def send(self, data: bytes) -> bytes:
        """Sends bytes, one a clock, and returns the answer."""
        if not data or self.failure:
            return b""
        clock = self.verilog.clock
        made = self.verilog.step(data, _LONGEST)
        wanted = self.model.feed(data, clock).data
        self.model.wait(self.verilog.clock)
        self.sent += len(data)
        self.answered += len(made)
        if self.verilog.backlog:
            self.failure = f"clock {clock}: no rest within {_LONGEST} clocks of {data.hex()}"
        elif made != wanted:
            place = next(
                (n for n, (one, two) in enumerate(zip(made, wanted, strict=False)) if one != two),
                min(len(made), len(wanted)),
            )
            self.failure = (
                f"clock {clock}: to {_short(data)} the Verilog answers {len(made)} bytes, the "
                f"model {len(wanted)}; from byte {place} on {_short(made[place:])} and "
                f"{_short(wanted[place:])}"
            )
        return made

    def silence(self, clocks: int) -> None:
        """Advances the clock."""
        if clocks > 0 and not self.failure:
            self.verilog.step(b"", clocks)
            self.model.wait(self.verilog.clock)


def _short(data: bytes) -> str:
    return (data[:24].hex() or "nothing") + "..." * (len(data) > 24)


def _send(pair: _Pair, rng: np.random.Generator) -> None:
    """One packet in one or two pieces, and the pause after it."""
    packet = _packet(rng)
    pair.began = pair.verilog.clock
    cut = int(rng.integers(1, len(packet) + 1)) if rng.random() < 0.3 else len(packet)
    pair.send(packet[:cut])
    for rest in (packet[cut:], b""):
        kind = rng.random()
        if kind < 0.12:  # so that the next byte comes about when the watchdog does
            due = pair.began + _PATIENCE + int(rng.integers(-4, 5))
            pair.silence(due - pair.verilog.clock)
        elif kind < 0.3:
            pair.silence(int(rng.integers(1, 40)))
        pair.send(rest)


def _packet(rng: np.random.Generator) -> bytes:
    """A packet, possibly with an error."""
    kind = rng.random()
    if kind < 0.05:
        return rng.bytes(int(rng.integers(1, 24)))
    command = int(rng.integers(1, 5)) if kind < 0.95 else int(rng.integers(256))
    length = int(rng.choice([1, 1, 1, 2, 3, 5, 9, int(rng.integers(256)) if kind < 0.1 else 4]))
    packet = bytes([command, length]) + _address(rng).to_bytes(4, "big")
    if command in (1, 3):
        words = rng.integers(1 << 32, size=length or 256)
        small = rng.random(words.size) < 0.7  # most registers are narrow
        words[small] &= 3
        packet += words.astype(">u4").tobytes()
    spoiled = bytearray(packet)
    spoil = rng.random()
    place = int(rng.integers(len(packet)))
    if spoil < 0.10:
        del spoiled[place + 1 :]
    elif spoil < 0.20:
        spoiled[place] ^= 1 << int(rng.integers(8))
    elif spoil < 0.25:
        del spoiled[place]
    elif spoil < 0.30:
        spoiled.insert(place, int(rng.integers(256)))
    elif spoil < 0.33:
        spoiled += rng.bytes(int(rng.integers(1, 12)))
    return bytes(spoiled) or b"\0"


def _address(rng: np.random.Generator) -> int:
    """A word address, mostly a valid one."""
    kind = rng.random()
    if kind < 0.75:
        return REGISTERS[rng.integers(len(REGISTERS))].address // 4
    if kind < 0.95:
        return MEMORIES[rng.integers(len(MEMORIES))].address // 4 + int(rng.integers(34))
    return int(rng.integers(1 << 32))
