"""The board under test: its port, its registers and the results of earlier stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from rtl_model.bringup.bench.deadline import Deadline, DeadlinePort, DeadlineSocket
from rtl_model.bringup.bench.monitor import LineMonitor
from rtl_model.bringup.bench.stage import StageFault
from rtl_model.bringup.bench.wrong_bits import WrongBits
from rtl_model.geometry import Geometry
from rtl_model.host import Bone, Uartbone
from rtl_model.host.countdown import Countdown
from rtl_model.host.csr import CsrMap
from rtl_model.host.ether import Etherbone
from rtl_model.registers import REGISTERS

_CHANGED_BY_READING = {register.name for register in REGISTERS if register.read_effect}

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Burst:
    """Captured planes and the expected ones.

    Attributes:
        name: name of the test pattern.
        got, expected: (frames, rows, columns) bool.
        wrong: the difference; None if there is none.
    """

    name: str
    got: npt.NDArray[np.bool_]
    expected: npt.NDArray[np.bool_]
    wrong: WrongBits | None


@dataclass
class Bench:
    """A board under test, over any line.

    Attributes:
        port: port to the board; a stage that exceeds its time ends with OutOfTime here.
        bone: the host's side of the protocol, on that port.
        csr: registers of the loaded design.
        simulated: whether there is no real clock behind the port.
        frames: number of frames in a captured burst.
        geometry: geometry of the board, once the identity stage has passed; a default before.
        board: figures of the identity stage; empty before it.
        bursts: captured so far.
        magic: word at address 0 as the first stage has read it, None before.
        note: receives one line before a slow step.
        monitor: compares the byte counts at both ends of the line; None until the board is known
            to have these counters.
    """

    port: Deadline
    bone: Bone
    csr: CsrMap
    simulated: bool
    frames: int = 8
    geometry: Geometry = field(default_factory=Geometry)
    board: dict[str, Any] = field(default_factory=dict)
    bursts: list[Burst] = field(default_factory=list)
    magic: int | None = None
    note: Callable[[str], None] = lambda text: None
    monitor: LineMonitor | None = None

    def address(self, name: str) -> int:
        """Byte address of a register."""
        return self.csr.register(name).address

    def read(self, name: str) -> int:
        """Reads a register once; a failed read is repeated unless reading changes the register."""
        return self.bone.read(self.address(name), retry=name not in _CHANGED_BY_READING)[0]

    def read_stable(self, name: str) -> int:
        """Reads a register that does not change by itself, until two readings agree."""
        return self.bone.read_twice(self.address(name))[0]

    def read_expecting(self, name: str, expected: int) -> int:
        """Reads a register that does not change by itself and should hold `expected`.

        If it does not, it is read until two readings agree. An answer that was wrong only once is
        counted as a fault of the line, not of the register.
        """
        first = self.read(name)
        if first == expected:
            return first
        value = self.read_stable(name)
        if value == expected:
            self.bone.other_answer(self.address(name), [first], [value])
        return value

    def repeat(self, check: Callable[[], Result], *kinds: str) -> Result:
        """Runs `check`, and repeats it once if it fails by one of these kinds.

        If the second run passes, the first one met a fault of the line, not of the design. The
        monitor counts it.
        """
        try:
            return check()
        except StageFault as fault:
            if fault.kind not in kinds or self.monitor is None:
                raise
            result = check()
        self.monitor.count_misplaced()
        return result

    def write(self, name: str, value: int) -> None:
        """Writes one register."""
        self.bone.write(self.address(name), value)

    def line_s(self, count: int) -> float:
        """Duration of `count` bytes on the line, s; 0 if unknown."""
        return self.bone.line_s(count)

    def limit(self, seconds: float) -> Countdown:
        """A limit for a loop that polls the board; a turn counts at most a tenth of it."""
        return Countdown(seconds, seconds / 10, self.port.now)

    def ticks_s(self, ticks: int, select: int = 0) -> float:
        """Duration of `ticks` ticks of the default length by the port's clock, s."""
        seconds = (ticks << select) * self.geometry.tick_clocks / self.geometry.clock_hz
        return seconds * self.bone.time_scale


@dataclass
class SerialBench(Bench):
    """A board on a serial line.

    Attributes:
        nominal_baud: baud that the user has set.
    """

    port: DeadlinePort
    bone: Uartbone
    nominal_baud: int = 0


@dataclass
class UdpBench(Bench):
    """A board on a network."""

    port: DeadlineSocket
    bone: Etherbone
