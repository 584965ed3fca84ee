"""What all pixels of conventional imagers have in common: light in, digital numbers out, effects
that can be left out, and what bounds read of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Effect, Summary

__all__ = ["Exposed", "ImagerSummary", "PixelModel", "Values"]

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ImagerSummary(Summary):
    """What bounds of an imager's effects read, besides `darkest` and `brightest`, which here are
    photoelectrons in a whole exposure (a `Summary`'s cycle is one frame, its threshold the full
    well, and window and cycles the frames that the run takes).

    exposure: seconds, shortest and longest. kelvin: of the chip. gain: electron multiplication at
    work, least and largest mean; (1, 1) for none. step: electrons of one DN at the pixel, before
    any multiplication.
    """

    exposure: tuple[float, float] = (0.0, 0.0)
    kelvin: float = 300.0
    gain: tuple[float, float] = (1.0, 1.0)
    step: float = 1.0


@dataclass(frozen=True, eq=False)
class Exposed:
    """Rows that have been exposed and wait to be converted.

    lux_seconds: (rows, W). seconds: (rows,) exposure, for what gathers in the dark. waiting:
    (rows,) seconds from the exposure's end to the row's readout. first: number of the first row.
    frame: number of the frame, which counts draws.
    """

    lux_seconds: Values
    seconds: Values
    waiting: Values
    first: int
    frame: int


class PixelModel(Protocol):
    """Physics of one imager's pixels, its analog chain and its converter.

    effects: all of them, by name; what is not in `kept` is left out of the computation. The draws
    of those that are kept do not change with what is left out. shape: (H, W). bits: of a value.
    """

    @property
    def effects(self) -> dict[str, Effect]: ...

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def bits(self) -> int: ...

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """(rows, W) DN of exposed rows. seed: of the temporal noise; the fixed pattern hangs on
        the model's own."""
        ...

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """Closed form: mean and temporal variance of a middling pixel's value, DN and DN^2, with
        every effect, before clipping at either end of the scale."""
        ...

    def summary(self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:  # fmt: skip
        """What bounds read, of the least and most light and exposure that the run will see."""
        ...
