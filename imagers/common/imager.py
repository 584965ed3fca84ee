"""The interface of an imager: registers in, frames out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # a host that only reads registers must not load the physics
    from cosim.frames import Frame
    from imagers.common.scenery import Scenery
    from sensor.frame_pixels import PixelModel

__all__ = ["Imager"]


class Imager(Protocol):
    """A whole imager. Time is integer picoseconds from power-on.

    Attributes:
        name: name of its kind in the catalogue.
        pixels: the physics of its pixels.
    """

    name: str

    @property
    def pixels(self) -> PixelModel: ...

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """Writes a register at an instant, ps; None for now. When the value takes effect depends on
        the register (`Design.updates`). Raises InputError, see `write_instant`."""
        ...

    def read(self, register: str) -> int:
        """Returns the present value of a register."""
        ...

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """Yields the frames that are ready from now to the instant `until`.

        Args:
            scene: light on the plane.
            until: end, ps.
            seed: seed of the temporal noise.
            kept: names of the effects that are computed.
            trace: file for the signals of the sequencer during the first frames, .fst or .vcd.
        """
        ...
