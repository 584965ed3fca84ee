"""Interface of the pixels of a conventional imager: from light to digital numbers, with effects
that can be left out, and the summary of a scene that the bounds of effects read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Effect, Summary

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ImagerSummary(Summary):
    """Summary of a run for the bounds of an imager's effects.

    A `Summary`'s cycle is one frame here: `darkest` and `brightest` are photoelectrons in a whole
    exposure, `threshold` is the full well, `window` and `cycles` are the frames of the run.

    Attributes:
        exposure: shortest and longest, s.
        kelvin: temperature of the chip.
        gain: least and largest mean of electron multiplication; (1, 1) for none.
        step: electrons of one DN at the pixel, before any multiplication.
    """

    exposure: tuple[float, float] = (0.0, 0.0)
    kelvin: float = 300.0
    gain: tuple[float, float] = (1.0, 1.0)
    step: float = 1.0


@dataclass(frozen=True, eq=False)
class Exposed:
    """Rows that have been exposed and are not converted yet.

    Attributes:
        lux_seconds: (rows, W) light, lx s.
        seconds: (rows,) exposure time, during which dark electrons accumulate, s.
        waiting: (rows,) time from the exposure's end to the row's readout, s.
        first: number of the first row.
        frame: number of the frame, which counts random draws.
    """

    lux_seconds: Values
    seconds: Values
    waiting: Values
    first: int
    frame: int


class PixelModel(Protocol):
    """Physics of one imager's pixels, its analog chain and its converter.

    Attributes:
        effects: all effects, by name. The random draws of one do not depend on which others are
            left out.
        shape: (H, W).
        bits: number of bits of a value.
    """

    @property
    def effects(self) -> dict[str, Effect]: ...

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def bits(self) -> int: ...

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """Values of exposed rows, (rows, W) DN.

        Args:
            rows: exposed rows.
            seed: seed of the temporal noise; the fixed pattern has the device's own seed.
            kept: names of the effects that are computed.
        """
        ...

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """Closed form: mean (DN) and temporal variance (DN^2) of a typical pixel's value, with
        every effect, before clipping at either end of the scale."""
        ...

    def summary(self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:  # fmt: skip
        """Summary for the bounds: a run within these ranges of light (lx s) and exposure (s)."""
        ...
