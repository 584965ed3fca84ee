"""A display that has shown a stream, for the pages of the report, and the camera that films it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from cosim import Clock, SpikeStream
from cosim.run.machine import Run
from cosim.run.result import Metric
from display.chain.outcome import DisplayOutcome


class Filmer(Protocol):
    """A camera that films the display of a run.

    Attributes:
        figures: names of the figures of its section, in the folder of the run.
    """

    @property
    def figures(self) -> list[str]: ...

    def stages(self, folder: Path) -> dict[str, Any]:
        """Its stages, after the display: they receive the planes, and pass them on."""
        ...

    def write(self, folder: Path, at: list[int]) -> list[str]:
        """Writes its pictures, and returns the names of all its files. at: instants, ps."""
        ...

    def metrics(self) -> dict[str, Metric]:
        """Its metrics, after the last block."""
        ...

    def cards(self) -> list[tuple[str, str, str]]:
        """Its large figures, for `cards`."""
        ...

    def section(self, shown: Shown) -> str:
        """HTML of its section; writes its figures."""
        ...


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
