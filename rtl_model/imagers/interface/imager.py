"""The interface of an imager: registers are written, frames come out."""

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

    Attributes:
        name: of its kind.
        pixels: its physics.

    Registers are those of its table (`registers`), at the byte addresses there.
    """

    name: str

    @property
    def pixels(self) -> PixelModel: ...

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """Writes a register at an instant (ps, not in the past; None for now). The value takes
        effect when the imager's own rule says so."""
        ...

    def read(self, register: str) -> int:
        """Returns the value of a register now."""
        ...

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """Films frame by frame from now to the instant `until`, ps. A frame that is not ready by
        then is not returned.

        Args:
            scene: light on the plane.
            until: end, ps.
            seed: of the temporal noise.
            kept: names of the effects that are computed.
            trace: file for the sequencer's signals during the first frames, .fst or .vcd.
        """
        ...
