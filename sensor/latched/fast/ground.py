"""What both forms of the fast tier start from: padded pixels, gains, flags, first charge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light
from sensor.device.pattern import FixedPattern
from sensor.latched.fast.course import Course, course_of
from sensor.latched.fast.units import (
    DEAD_TIME,
    DEEPEST,
    NOISE,
    RESET,
    Units,
    first_charge,
    running,
    units_of,
)
from sensor.latched.pixel.fixed_point import LARGEST
from sensor.latched.pixel.model import ExactModel

__all__ = ["LANES", "Ground"]

LANES: Final = 16
"""Pixels in a group: neighbours in a row, a vector of 32-bit integers on a 512-bit processor."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A plane of pixels and its setting, as `FastPixels` takes them; checked here."""

    model: ExactModel
    shape: tuple[int, int]
    numbers: npt.NDArray[np.uint32]
    clock: Clock
    gain: float
    pattern: FixedPattern | None = None
    offsets: npt.NDArray[np.int64] | None = None
    flags: npt.NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        height, width = self.shape
        if self.numbers.size != height * width:
            raise ValueError(f"numbers must be {height * width}, not {self.numbers.size}")
        if self.offsets is not None and self.offsets.size not in (1, height):
            raise ValueError(f"offsets must be {height}, not {self.offsets.size}")
        if self.flags is not None and self.flags.shape != self.groups:
            raise ValueError(f"flags must have shape {self.groups}, not {self.flags.shape}")

    @property
    def groups(self) -> tuple[int, int]:
        """Rows, and groups in a row, the last filled up with pixels that get no light."""
        return self.shape[0], -(-self.shape[1] // LANES)

    @cached_property
    def kept(self) -> npt.NDArray[np.uint8]:
        """Flags of each group: what is asked for, as far as the model has it."""
        own = NOISE * self.model.noisy | DEAD_TIME * (self.model.dead > 0)
        asked = np.full(self.groups, 255, np.uint8) if self.flags is None else self.flags
        rule = RESET * (self.model.reset != "residual")
        return np.ascontiguousarray(asked & np.uint8(own) | np.uint8(rule))

    @cached_property
    def units(self) -> Units:
        return units_of(self.model)

    @cached_property
    def deepest(self) -> int:
        """Least deficit under `subtract`."""
        return max(DEEPEST, -round(LARGEST / self.model.mean * self.units.one))

    @cached_property
    def late(self) -> npt.NDArray[np.int64]:
        """Offsets of the rows, one for all where there are none."""
        return np.zeros(1, np.int64) if self.offsets is None else self.offsets.astype(np.int64)

    def padded(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(rows, groups x 16) of an array of all pixels, with 0 for those that fill up."""
        height, width = self.shape
        wide = self.groups[1] * LANES
        return np.pad(values.reshape(height, width), ((0, 0), (0, wide - width)))

    def trimmed(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The pixels' own part of a padded array, flat."""
        return values.reshape(self.shape[0], -1)[:, : self.shape[1]].ravel()

    @property
    def dead(self) -> np.float32:
        """Share of a cycle's light that a spike costs."""
        return np.float32(self.model.dead / 65536)

    @property
    def scale(self) -> float:
        """Thresholds a cycle for a unit of light, without pattern."""
        return self.gain * float(self.clock.period) / self.model.mean

    @property
    def brightest(self) -> np.float32:
        """Level at which light is held, in thresholds a cycle, an int32 in any case."""
        return np.float32(min(LARGEST / self.model.mean, 2.0**30))

    @property
    def ratio(self) -> float:
        """Nominal thresholds in a threshold as charge is counted here, with its shift."""
        return self.model.mean / self.model.threshold

    @cached_property
    def gains(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None:
        """Thresholds a cycle for a unit of light, and in the dark, of each padded pixel."""
        if self.pattern is None:
            return None
        dark = self.pattern.dark * (float(self.clock.period) / self.model.mean)
        return (
            self.padded((self.pattern.gain * self.scale).astype(np.float32)),
            self.padded(dark.astype(np.float32)),
        )

    def first(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.uint64]]:
        """Charge and spike index of every padded pixel before the first cycle."""
        flags = self.trimmed(np.repeat(self.kept, LANES, axis=1))
        charge = self.padded(first_charge(self.model, self.units, self.numbers, flags))
        return charge, np.zeros(charge.shape, np.uint64)

    def course(self, light: Light, start: int, cycles: int) -> Course:
        """The course of light over a call. Raises ValueError for light of another shape or time."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        return course_of(light, self.clock, self.late, start, cycles, self._most)

    @cached_property
    def _most(self) -> Any:
        """Light at which a pixel's is held."""
        if self.pattern is None:
            return float(self.brightest) / self.scale if self.scale else np.inf
        gain = np.maximum(self.pattern.gain * self.scale, 1e-300).reshape(self.shape)
        dark = self.pattern.dark.reshape(self.shape) * float(self.clock.period)
        return np.maximum(float(self.brightest) - dark / self.model.mean, 0) / gain

    def fraction(
        self, charge: npt.NDArray[np.int32], spikes: npt.NDArray[np.uint64]
    ) -> npt.NDArray[np.float64]:
        """Stored charge over the running interval's own threshold, from padded state."""
        flags = self.trimmed(np.repeat(self.kept, LANES, axis=1))
        charge, spikes = self.trimmed(charge), self.trimmed(spikes)
        threshold = np.ones(charge.shape)
        drawn = (flags & NOISE) != 0
        if drawn.any():
            threshold[drawn] = running(self.model, spikes[drawn], self.numbers[drawn])
        threshold = np.maximum(threshold, 1 / self.units.one)
        stored = 1 - (charge + 1.0) / (threshold * self.units.one)
        # After light that fires in every cycle the deficit is that of a threshold at the mean.
        held = np.clip(stored, 0.0 if self.model.dead == 0 else -np.inf, 1.0)
        return np.where(flags == 0, charge.view(np.uint32) / 2.0**32, held)
