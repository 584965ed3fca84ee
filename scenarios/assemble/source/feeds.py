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

from dataclasses import dataclass
from typing import Protocol

from cosim import Clock
from cosim.run.machine import Outcome, Recording
from cosim.run.result import Metric
from cosim.spikes.clocked import (
    ClockedEvents,
    HeldPlanes,
)
from cosim.stage import Stage


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
class PlainFeed:
    """The attributes of a `Feed`."""

    shape: tuple[int, int]
    clock: Clock
    cycles: int
    white_rate: float
    white: str
