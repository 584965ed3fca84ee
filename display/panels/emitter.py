"""The emitter of a pixel in compiled code: the relaxation that patches and waveforms share."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from display.panels.panel import SpikePanel


class Emitter(NamedTuple):
    """The emitter of a pixel, for compiled kernels.

    Attributes:
        share: share of a plane in which the pixel is driven.
        rise, decay: time constants, planes; 0 for none.
    """

    share: float
    rise: float
    decay: float

    @classmethod
    def of(cls, panel: SpikePanel) -> Emitter:
        hz = panel.clock.hz
        return cls(panel.share, panel.rise * hz, panel.decay * hz)


@njit(cache=True, nogil=True)
def gone_in(length, constant):  # type: ignore[no-untyped-def]
    """The time constant, planes, and the relative decrease of a difference after `length`, planes;
    1 without a time constant."""
    return constant, -math.expm1(-length / constant) if constant > 0 else 1.0


@njit(cache=True, nogil=True)
def relax(drive, length, level, up, down):  # type: ignore[no-untyped-def]
    """The light of a part of a plane under constant drive, and the level at its end. `up`, `down`:
    `gone_in` of the part, rising and falling."""
    constant, gone = up if drive > level else down
    return drive * length + (level - drive) * constant * gone, level + (drive - level) * gone
