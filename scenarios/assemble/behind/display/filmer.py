"""What every camera before a display does for the run and its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from cosim.run.result import Metric

if TYPE_CHECKING:  # a display that was shown has a camera
    from scenarios.assemble.behind.display.shown import Shown


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
