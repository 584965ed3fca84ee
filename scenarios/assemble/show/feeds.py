"""The output of every kind of source as spike planes for a display.

| source | planes |
|---|---|
| asynchronous pixels | each full spike in the cycle of sensor.clock that latches it |
| the same, sending changes alone | the rate Q / width, held until the next event |
| continuous pixels | the reported value, held; the scene's white fires at sensor.lens.white_rate |
| imagers | the digital number, held from the end of one readout to that of the next |
| a recorded stream | its planes as they are |

Held values fire by a digital integrate-and-fire in integers (`HeldPlanes`): their rate is the value
over that of a spike in every cycle, and the number of spikes is within one of the closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from cosim import Clock, Events, InputError
from cosim.config.amounts import at_least
from cosim.config.quantity import FASTEST
from cosim.files import ZarrStream
from cosim.run.chain import STREAM
from cosim.run.machine import Outcome, Recording
from cosim.run.result import Metric
from cosim.spikes.clocked import (
    Change,
    ClockedEvents,
    HeldPlanes,
    latching_cycles,
)
from cosim.spikes.events import only_full
from cosim.spikes.excerpt import StreamStage
from cosim.spikes.held import held_events, held_reports
from cosim.stage import Stage
from imagers.common.model import FrameFigures, ImagerModel
from imagers.machine import ImagerMachine
from imagers.run.tape import FRAMES, read_frame
from scenarios.assemble.recording.machine import RecordingMachine
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.continuous.machine import ContinuousMachine


@dataclass(frozen=True, eq=False)
class Planes:
    """The stage that makes the planes of a display from a recording.

    Attributes:
        stage: emits the planes of each block; its input is not used.
        stored: whether the planes are the stream of the run's folder already.
        partial: readings of the charge without a spike, which are not shown.
    """

    stage: Stage
    stored: bool = False
    partial: int = 0

    def metrics(self) -> dict[str, Metric]:
        """What the planes hold and lack, after the last block."""
        stage, found = self.stage, {}
        if isinstance(stage, ClockedEvents):
            found = {
                "shown_spikes": stage.spikes, "shown_lost": stage.lost, "shown_late": stage.late,
                "shown_readings_left_out": self.partial,
            }  # fmt: skip
        if isinstance(stage, HeldPlanes):
            found = {
                "shown_spikes": stage.spikes, "shown_values": stage.given,
                "shown_clipped": stage.clipped,
            }  # fmt: skip
        return {name: Metric(float(count), "1") for name, count in found.items()}

    def notes(self) -> list[str]:
        """What the user must know of the planes."""
        stage, notes = self.stage, []
        if isinstance(stage, ClockedEvents) and stage.lost:
            share = stage.lost / (stage.spikes + stage.lost)
            notes.append(
                f"{stage.lost} spikes ({share:.2g} of all) came in a cycle in which their pixel "
                "had fired already and are not shown: raise sensor.clock"
            )
        if isinstance(stage, HeldPlanes) and stage.clipped:
            notes.append(
                f"{stage.clipped} of {stage.given} values are above a spike in every cycle and are "
                "shown as that"
            )
        if self.partial:
            notes.append(f"{self.partial} readings of pixels that did not fire are not shown")
        return notes


class Feed(Protocol):
    """How the output of a machine feeds a display.

    Attributes:
        shape: (height, width) of the planes.
        clock, cycles: clock and number of the planes.
        white_rate: spikes a cycle of the scene's white.
        white: what white means, in words, for the notes.
    """

    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def clock(self) -> Clock: ...
    @property
    def cycles(self) -> int: ...
    @property
    def white_rate(self) -> float: ...
    @property
    def white(self) -> str: ...

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """The planes of a recording and its evaluation by the machine."""
        ...


@dataclass(frozen=True, eq=False)
class _Plain:
    shape: tuple[int, int]
    clock: Clock
    cycles: int
    white_rate: float
    white: str


class EventFeed(_Plain):
    """The events of asynchronous pixels."""

    def __init__(self, machine: AsynchronousMachine) -> None:
        spec = machine.spec
        clock = spec.setting.clock
        rate = (
            spec.illuminance * spec.lens.gain * spec.setting.electrons_per_lux
            / (spec.model.threshold * clock.hz)
        )  # fmt: skip
        if rate * clock.hz > FASTEST:
            raise InputError(
                "display", f"absent where white fires at {rate * clock.hz:.3g} Hz, more than a "
                "spike a cycle of the fastest sensor.clock", "given",
                "leave it out, raise sensor.threshold, or close the lens (sensor.lens.f_number)",
            )  # fmt: skip
        if rate > 1:
            raise InputError(
                "sensor.clock",
                f"at least {at_least(rate * clock.hz, 4)} Hz with a [display]: white must "
                "fire at most once a cycle", f"{clock.hz:g} Hz",
                "raise it or sensor.threshold, or close the lens (sensor.lens.f_number)",
            )  # fmt: skip
        self._changes = spec.model.change > 0
        told = "the width of an event, held until the next" if self._changes else "as it fires"
        super().__init__(
            spec.shape, clock, spec.cycles, rate,
            f"the scene's white, {rate:.3g} spikes a cycle: {told}",
        )  # fmt: skip

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        events: Events = outcome.views.events
        if self._changes:
            return Planes(held_events(events, self.clock, self.cycles))
        full, partial = only_full(events)
        return Planes(ClockedEvents(full, self.clock, self.cycles), partial=partial)


class ContinuousFeed(_Plain):
    """The reports of continuous pixels."""

    def __init__(self, machine: ContinuousMachine) -> None:
        spec = machine.spec
        rate, chip = spec.section.lens.white_rate, spec.setting.chip
        self._white = spec.white
        super().__init__(
            (chip.height, chip.width), spec.setting.clock, spec.cycles, rate,
            f"the scene's white, {spec.white:.3g} electrons/s, fires at sensor.lens.white_rate = "
            f"{rate:g}",
        )  # fmt: skip

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        return Planes(held_reports(outcome.views.reports, self._white, self.white_rate))


class _Frames:
    """The frames of an imager as `Changes`; those that no cycle shows are not read."""

    def __init__(
        self, frames: Sequence[FrameFigures], path: Path, model: ImagerModel, bits: int,
        lux: float, cycles: Any,
    ) -> None:  # fmt: skip
        self._frames, self._path, self._model = frames, path, model
        self._bits, self._lux, self._cycles = bits, lux, cycles
        self.white = model.levels(np.zeros((1, 1), np.uint16), bits, lux)[1]

    def between(self, start: int, stop: int) -> list[Change]:
        """See `Changes`."""
        first, last = np.searchsorted(self._cycles, [start, stop])
        return [self._change(n) for n in range(int(first), int(last))]

    def _change(self, n: int) -> Change:
        values = read_frame(self._path, n)
        levels, _ = self._model.levels(values, self._bits, self._lux)
        (rows, columns), plane = values.shape, self._model.shape
        if values.shape == plane:
            return Change(int(self._cycles[n]), None, levels.ravel())
        row = np.arange(rows) + self._model.first_row(self._frames[n].state)
        pixel = (row[:, None] * plane[1] + np.arange(columns)).ravel()
        return Change(int(self._cycles[n]), pixel, levels.ravel())


class FrameFeed(_Plain):
    """The frames of an imager."""

    def __init__(self, machine: ImagerMachine, clock: Clock, lux: float) -> None:
        """lux: illuminance of the scene's white on the plane."""
        planned = machine.planned
        self._planned, self._lux = planned, lux
        levels = planned.model.levels(np.zeros((1, 1), np.uint16), planned.pixels.bits, lux)[1]
        super().__init__(
            planned.model.shape, clock, max(clock.cycles_in(planned.spec.stop), 1), 1.0,
            f"a value of {levels}, which fires in every cycle; a frame is shown from the end of "
            "its readout to that of the next",
        )  # fmt: skip

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        frames, planned = recording.chain.frames, self._planned
        ready = np.array([frame.ready for frame in frames], np.int64)
        cycle = latching_cycles(ready, self.clock, self.cycles)
        changes = _Frames(
            frames, recording.folder / FRAMES, planned.model, planned.pixels.bits, self._lux, cycle
        )
        return Planes(HeldPlanes(changes, self.shape, self.clock, changes.white))


class RecordedFeed(_Plain):
    """A recorded stream."""

    def __init__(self, machine: RecordingMachine) -> None:
        found = machine.recording
        super().__init__(
            found.shape, found.clock, found.cycles, found.white_rate,
            f"{found.white_rate:.3g} spikes a cycle",
        )  # fmt: skip

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        return Planes(StreamStage(ZarrStream(recording.folder / STREAM)), stored=True)
