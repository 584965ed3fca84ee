"""A display that has shown a stream, for the pages of the report."""

from __future__ import annotations

from dataclasses import dataclass

from cosim import Clock, SpikeStream
from cosim.run.machine import Run
from display.chain.outcome import DisplayOutcome
from scenarios.assemble.behind.display.filmer import Filmer


@dataclass(frozen=True, eq=False)
class Shown:
    """A display after a run.

    Attributes:
        run: the run: result, folder, wall times.
        outcome: what the observers of the display have seen.
        clock: clock of the stream.
        instants: cycles of the images.
        stream: the stream that was shown.
        camera: the camera that has filmed the panel; None without one.
        overview: name of the figure with all displays.
    """

    run: Run
    outcome: DisplayOutcome
    clock: Clock
    instants: list[int]
    stream: SpikeStream
    camera: Filmer | None = None
    overview: str = "overview.png"
