"""The registers of the EMCCD and the sequencer that reads them, cycle by cycle. The five parameters
take effect together, at the start of a cycle.

Between two cycles the sequencer waits. At an edge of the wait, the next cycle begins if the sync
register is set to internal, or if a pulse arrives at that edge. All parameters then take effect
together. So a host can release a camera that waits for pulses. (The document tests sync at the end
of a cycle and takes the parameters before the next one. That the register is also tested during the
wait is assumed.) A pulse that arrives during a cycle is lost; a register counts these pulses.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable
from typing import Final

from imagers.common.registers import RegisterFile
from imagers.emccd.device.sequencer import Cycle, Phase
from imagers.emccd.device.timing import EXPOSURE_STEPS, Settings, Timing
from rtl_model.registers import Field, Register
from rtl_model.registers.design import Design, Update

_FIRST: Final = Settings()

PARAMETERS: Final = (
    "emccd_exposure", "emccd_gain", "emccd_first_row", "emccd_rows", "emccd_sync",
)  # fmt: skip
"""Registers that take effect at the start of a cycle."""

REGISTERS: Final[tuple[Register, ...]] = (
    Register(
        "emccd_exposure", 0x300, "rw", _FIRST.steps, 13,
        f"exposure in steps of 10 us, 1 to {EXPOSURE_STEPS}; others as the nearest",
    ),
    Register("emccd_gain", 0x304, "rw", 0, 8, "step of the high voltage's potentiometer"),
    Register("emccd_first_row", 0x308, "rw", 0, 9, "image row where the window begins"),
    Register("emccd_rows", 0x30C, "rw", _FIRST.rows, 10, "rows of the window, cut at the last row"),
    Register("emccd_sync", 0x310, "rw", 0, 1, "0 internal, 1 external: a cycle waits for a pulse"),
    Register("emccd_trigger", 0x314, "wo", 0, 1, "1 gives a sync pulse, as the input does"),
    Register(
        "emccd_state", 0x320, "ro", 0, 3, "what the sequencer does",
        fields=(
            Field(
                "phase", 2, 0,
                "0 waits, 1 first transfer, 2 exposure, 3 second transfer, 4 clear, "
                "5 dump before, 6 readout, 7 dump after",
            ),
        ),
    ),
    Register("emccd_cycles", 0x324, "ro", 0, 32, "cycles begun"),
    Register("emccd_frames", 0x328, "ro", 0, 32, "frames whose last pixel has left"),
    Register("emccd_cycle_clock", 0x32C, "ro", 0, 32, "ctrl_uptime when the last cycle began"),
    Register("emccd_frame_clocks", 0x330, "ro", 0, 32, "clocks of the cycle at work"),
    Register("emccd_pulses_lost", 0x334, "ro", 0, 32, "sync pulses that no cycle waited for"),
    Register("emccd_work_exposure", 0x340, "ro", 0, 13, "exposure at work, steps of 10 us"),
    Register("emccd_work_gain", 0x344, "ro", 0, 8, "gain step at work"),
    Register("emccd_work_first_row", 0x348, "ro", 0, 9, "first row at work"),
    Register("emccd_work_rows", 0x34C, "ro", 0, 10, "rows at work"),
)  # fmt: skip

_UPDATES: Final[dict[str, Update]] = dict.fromkeys(PARAMETERS, "cycle")


def design(timing: Timing | None = None) -> Design:
    """The design behind the serial line, with the clock and size of `timing`."""
    timing = timing or Timing()
    return Design(
        "emccd", 3, "frame-transfer EMCCD", (timing.rows, timing.columns), timing.clock_hz,
        REGISTERS, _UPDATES,
    )  # fmt: skip


DESIGN: Final = design()


class EmccdSequencer:
    """The sequencer from power-on, edge 0; see `BusTarget`.

    Attributes:
        clock: number of edges passed.
        cycle: present or last cycle; None before the first.

    Args:
        timing: timing of the camera; None for the default.
        pulses: edges at which sync pulses arrive.
        begun: function that is called with each cycle when it begins.
    """

    def __init__(
        self,
        timing: Timing | None = None,
        pulses: Iterable[int] = (),
        begun: Callable[[Cycle], None] | None = None,
    ) -> None:
        self.timing = timing or Timing()
        self.registers = RegisterFile(design(self.timing))
        self._pulses = sorted(pulses)
        self._begun = begun
        self.clock = 0
        self._start(0)
        work = {"exposure": "steps", "gain": "gain_step", "first_row": "first", "rows": "rows"}
        for name, field in work.items():
            self.registers.on_read[f"emccd_work_{name}"] = lambda field=field: self._at_work(field)  # type: ignore[misc]
        self.registers.on_read |= {
            "emccd_state": lambda: int(self.phase),
            "emccd_cycles": lambda: self._cycles,
            "emccd_frames": lambda: self.frames,
            "emccd_cycle_clock": lambda: self.cycle.start if self.cycle else 0,
            "emccd_frame_clocks": lambda: self.cycle.clocks if self.cycle else 0,
            "emccd_pulses_lost": lambda: self._lost,
        }
        self.registers.on_write["emccd_trigger"] = self._trigger

    def _start(self, clock: int) -> None:
        self.cycle: Cycle | None = None
        self._cycles = self._lost = 0
        self._waits = clock  # first edge at which the next cycle may begin

    def reset(self, clock: int) -> None:
        """Restarts at edge `clock`; a running cycle is aborted."""
        self.clock = max(self.clock, clock)
        self._start(clock)

    @property
    def phase(self) -> Phase:
        """Phase of the clock before the next edge."""
        return Phase.WAIT if self.cycle is None else self.cycle.phase(self.clock - 1)

    @property
    def frames(self) -> int:
        """Number of frames whose last pixel has left before the next edge."""
        return self._cycles - (self.cycle is not None and self.clock <= self.cycle.ready)

    def advance(self, clock: int) -> None:
        """Runs all edges before `clock`; does nothing if that clock has passed."""
        while self.run(clock):
            continue

    def run(self, clock: int) -> bool:
        """Runs all edges before `clock`, or until a cycle begins. Returns whether one began."""
        if clock <= self.clock:
            return False
        waits = max(self._waits, self.clock)
        external = bool(self.registers.read("emccd_sync"))
        while self._pulses and self._pulses[0] < min(waits, clock):
            self._lost += 1
            self._pop(self._pulses[0])
        edge = waits
        if external:
            edge = self._pulses[0] if self._pulses else clock
        if edge >= clock:
            self.clock = clock
            return False
        self._lost += not external and bool(self._pulses) and self._pulses[0] == edge
        self._pop(edge)
        self._begin(edge)
        return True

    def _pop(self, edge: int) -> None:
        """Removes all pulses of one edge; together they count as one."""
        while self._pulses and self._pulses[0] == edge:
            heapq.heappop(self._pulses)

    def _begin(self, edge: int) -> None:
        file = self.registers
        file.update("cycle")
        settings = Settings(
            steps=file.active("emccd_exposure"),
            first=file.active("emccd_first_row"),
            rows=file.active("emccd_rows"),
            gain_step=file.active("emccd_gain"),
            external=bool(file.active("emccd_sync")),
        ).within(self.timing)
        self.cycle = Cycle(self._cycles, edge, self.timing, settings)
        self._cycles += 1
        self._waits = self.cycle.end
        self.clock = edge + 1
        if self._begun is not None:
            self._begun(self.cycle)

    def _trigger(self, value: int) -> None:
        if value & 1:
            heapq.heappush(self._pulses, self.clock)

    def _at_work(self, field: str) -> int:
        return int(getattr(self.cycle.settings, field)) if self.cycle else 0


def bus_target() -> EmccdSequencer:
    """The camera of `viform board virtual`."""
    return EmccdSequencer()
