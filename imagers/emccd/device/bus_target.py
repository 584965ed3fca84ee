"""The sequencer of the EMCCD with its registers, cycle by cycle.

Between two cycles the sequencer waits. At an edge of the wait, the next cycle begins if the sync
register is set to internal, or if a pulse arrives at that edge. All parameters then take effect
together. So a host can release a camera that waits for pulses. (The document tests sync at the end
of a cycle and takes the parameters before the next one. That the register is also tested during the
wait is assumed.) A pulse that arrives during a cycle is lost; a register counts these pulses.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

from imagers.common.register_file import RegisterFile
from imagers.emccd.device.registers import design
from imagers.emccd.device.sequencer import Cycle, Phase
from imagers.emccd.device.timing import Settings, Timing

__all__ = ["EmccdSequencer", "bus_target"]


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
