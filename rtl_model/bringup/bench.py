"""What the stages work on: one port, the board behind it, and what is known of it so far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from rtl_model.bringup.deadline import DeadlinePort
from rtl_model.bringup.line import Line
from rtl_model.bringup.stage import StageFault
from rtl_model.bringup.wrong_bits import WrongBits
from rtl_model.geometry import Geometry
from rtl_model.host.csr import CsrMap
from rtl_model.host.uartbone import Uartbone
from rtl_model.registers import REGISTERS

__all__ = ["Bench", "Burst"]

_CHANGED_BY_READING = {register.name for register in REGISTERS if register.read_effect}

Kept = TypeVar("Kept")


@dataclass(frozen=True, eq=False)
class Burst:
    """Captured planes beside those that had to come, (frames, rows, columns) bool."""

    name: str
    got: npt.NDArray[np.bool_]
    expected: npt.NDArray[np.bool_]
    wrong: WrongBits | None


@dataclass
class Bench:
    """A board under test. `geometry` is known once the identity stage has passed; `given_baud` is
    what the user said, `simulated` whether there is no real clock behind the port. `note` is told
    what takes long."""

    port: DeadlinePort
    bone: Uartbone
    csr: CsrMap
    simulated: bool
    given_baud: int
    frames: int = 8
    geometry: Geometry = field(default_factory=Geometry)
    board: dict[str, Any] = field(default_factory=dict)
    bursts: list[Burst] = field(default_factory=list)
    magic: int | None = None  # as the stage bytes read it
    note: Callable[[str], None] = lambda text: None
    line: Line | None = None  # once it is known that the counters are ours

    def address(self, name: str) -> int:
        """Byte address of a register."""
        return self.csr.register(name).address

    def get(self, name: str) -> int:
        """Reads one register; no retry where reading changes it."""
        return self.bone.read(self.address(name), retry=name not in _CHANGED_BY_READING)[0]

    def sure(self, name: str) -> int:
        """Reads a register that stands still, until two readings agree."""
        return self.bone.read_twice(self.address(name))[0]

    def confirmed(self, name: str, must: int) -> int:
        """Reads a register that stands still and should be `must`; where it is not, until two
        readings agree. An answer that was wrong once is none of the register's doing."""
        got = self.get(name)
        if got == must:
            return got
        held = self.sure(name)
        if held == must:
            self.bone.other_answer(self.address(name), [got], [held])
        return held

    def twice(self, check: Callable[[], Kept], *kinds: str) -> Kept:
        """Returns what `check` returns. Where it fails by one of these kinds it is run again: what
        then passes was no fault of the design, and the line is told of it."""
        try:
            return check()
        except StageFault as fault:
            if fault.kind not in kinds or self.line is None:
                raise
            kept = check()
        self.line.misplaced()
        return kept

    def put(self, name: str, value: int) -> None:
        """Writes one register."""
        self.bone.write(self.address(name), value)

    def line_s(self, count: int) -> float:
        """Seconds that `count` bytes take on the line at the host's baud."""
        return 10 * count / self.bone.baud

    def ticks_s(self, ticks: int, select: int = 0) -> float:
        """Seconds of the port's clock that so many ticks of the reset's length take."""
        seconds = (ticks << select) * self.geometry.tick_clocks / self.geometry.clock_hz
        return seconds * self.bone.time_scale
