"""What every imager does, whatever is inside it: registers are written, frames come out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # at run time a host that only reads registers needs none of it
    from cosim.frames import Frame
    from sensor.imagers import PixelModel, Scenery

__all__ = ["Imager"]


class Imager(Protocol):
    """A whole imager. Time is integer picoseconds from power-on.

    name: of its kind. pixels: its physics. Registers are those of its table (`registers`), at the
    byte addresses there; a write takes effect when the imager's own rule says so, which is tested.
    """

    name: str

    @property
    def pixels(self) -> PixelModel: ...

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """A register is written at this instant (ps; now when None, never in the past)."""
        ...

    def read(self, register: str) -> int:
        """Its value now."""
        ...

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """Runs from where it stands to the instant `until` (ps), frame by frame; a frame that is
        not ready by then is not delivered. trace: writes the sequencer's signals of the first
        frames, .fst or .vcd by the file's ending."""
        ...
