"""A pixel array of the fast tier: padded pixels, gains, flags and initial charge.

The OpenCL form (pixels.py) and the numpy form (in the tests) both start from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Box, Light
from sensor.device.pattern import FixedPattern
from sensor.latched.fast.course import Course, check_covered, course_of, parts_of
from sensor.latched.fast.runs import LaunchCache
from sensor.latched.fast.units import (
    BANK,
    DEAD_TIME,
    DEEPEST,
    JITTER,
    NOISE,
    NOTHING,
    RESET,
    TIMING,
    Units,
    current_thresholds,
    first_charge,
    units_of,
)
from sensor.latched.pixel.bank import LANES, Bank, bank_of, groups_of, has_bank
from sensor.latched.pixel.charge import LARGEST
from sensor.latched.pixel.model import ExactModel
from sensor.latched.sampling import PixelTiming, RowMoves


@dataclass(frozen=True, eq=False)
class PixelArray:
    """A plane of pixels with its setting.

    Attributes:
        model: rules of a pixel; any reset rule.
        shape: (H, W) of the plane.
        numbers: (H W,) uint32, numbers of the pixels on the chip.
        clock: clock of the latches.
        gain: photoelectrons a second per unit of light.
        pattern: fixed pattern of these pixels, None if all are nominal.
        offsets: (H,) or (1,) int64, ps from a clock edge to the sampling instant of each row; None
            for 0.
        flags: (H, ceil(W / 16)) uint8, effects kept in each group of sixteen columns: 1 noise, 2
            dead time; 16 draws its noise from the bank. None for all effects that the model has,
            without the bank.
        moves: moves of the sampling instants of rows, None for none.
        timing: timing noise of the pixels, None for none.

    Raises:
        ValueError: `numbers`, `offsets` or `flags` do not fit the shape.
    """

    model: ExactModel
    shape: tuple[int, int]
    numbers: npt.NDArray[np.uint32]
    clock: Clock
    gain: float
    pattern: FixedPattern | None = None
    offsets: npt.NDArray[np.int64] | None = None
    flags: npt.NDArray[np.uint8] | None = None
    moves: RowMoves | None = None
    timing: PixelTiming | None = None

    def __post_init__(self) -> None:
        height, width = self.shape
        if self.numbers.size != height * width:
            raise ValueError(f"numbers must be {height * width}, not {self.numbers.size}")
        if self.offsets is not None and self.offsets.size not in (1, height):
            raise ValueError(f"offsets must be {height}, not {self.offsets.size}")
        if self.flags is not None and self.flags.shape != self.groups:
            raise ValueError(f"flags must have shape {self.groups}, not {self.flags.shape}")

    def seeded(self, model: ExactModel, timing: PixelTiming | None) -> PixelArray:
        """The same pixels with another seed: its model, and its timing noise.
        What does not depend on the seed is shared."""
        other = replace(self, model=model, timing=timing)
        names = (
            "group_flags", "pixel_flags", "banked", "_ramps", "units", "bank", "_groups_of",
            "deepest", "row_offsets", "gains", "_dark", "_most", "launches", "own_launches",
        )  # fmt: skip
        other.__dict__.update({n: self.__dict__[n] for n in names if n in self.__dict__})
        return other

    @property
    def groups(self) -> tuple[int, int]:
        """Rows, and groups in a row. The last group is padded with pixels without light."""
        return self.shape[0], -(-self.shape[1] // LANES)

    @cached_property
    def group_flags(self) -> npt.NDArray[np.uint8]:
        """(H, groups) uint8: the requested flags that the model has, and RESET, TIMING and
        JITTER where needed."""
        possible = NOISE * self.model.noisy | DEAD_TIME * (self.model.dead > 0)
        requested = np.full(self.groups, 255 - BANK, np.uint8) if self.flags is None else self.flags
        rule = RESET * (self.model.reset != "residual")
        flags = np.ascontiguousarray(requested & np.uint8(possible) | np.uint8(rule))
        if has_bank(self.model):
            flags[(flags & NOISE) != 0] |= (requested & np.uint8(BANK))[(flags & NOISE) != 0]
        if self.moves is not None:
            flags[self.moves.first : self.moves.stop] |= np.uint8(TIMING)
        if self.timing is not None:
            flags[self.timing.first : self.timing.stop][self.timing.noisy] |= np.uint8(JITTER)
        return flags

    @cached_property
    def pixel_flags(self) -> npt.NDArray[np.uint8]:
        """Flags of the group of each pixel, (H W,)."""
        return self.trimmed(np.repeat(self.group_flags, LANES, axis=1))

    @cached_property
    def banked(self) -> bool:
        """Whether any group draws from the bank."""
        return bool((self.group_flags & BANK).any())

    @cached_property
    def _ramps(self) -> bool:
        """Whether any group adds light in whole steps: those without flags and with the bank."""
        return self.banked or bool((self.group_flags == 0).any())

    @cached_property
    def units(self) -> Units:
        """Units of charge, and the table of thresholds in them."""
        return units_of(self.model)

    @cached_property
    def bank(self) -> Bank:
        """The bank of thresholds, in the same units. Raises ValueError if the model has none."""
        return bank_of(self.model, self.units.bits)

    @property
    def over(self) -> int:
        """Light of a cycle, in units, from which pixels that draw from the bank lose whole
        thresholds at their mean: more than one that they certainly cross, and more than two of the
        shortest, up to which both are drawn."""
        return max(self.bank.top, 2 * self.bank.shortest)

    @cached_property
    def _groups_of(self) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
        return groups_of(self.numbers, self.shape)

    @cached_property
    def deepest(self) -> int:
        """Lowest deficit under `subtract`, in units."""
        return max(DEEPEST, -round(LARGEST / self.model.mean * self.units.one))

    @cached_property
    def row_offsets(self) -> npt.NDArray[np.int64]:
        """(H,) or (1,) int64, ps from a clock edge to the sampling instant of each row."""
        return np.zeros(1, np.int64) if self.offsets is None else self.offsets.astype(np.int64)

    def padded(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(rows, groups x 16) from values of all pixels, with 0 in the padding."""
        height, width = self.shape
        wide = self.groups[1] * LANES
        return np.pad(values.reshape(height, width), ((0, 0), (0, wide - width)))

    def trimmed(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(H W,) from padded values, without the padding."""
        return values.reshape(self.shape[0], -1)[:, : self.shape[1]].ravel()

    @property
    def dead(self) -> np.float32:
        """Share of a cycle's light that is lost at each spike."""
        return np.float32(self.model.dead_time)

    @property
    def scale(self) -> float:
        """Thresholds a cycle per unit of light, for a nominal pixel."""
        return self.gain * float(self.clock.period) / self.model.mean

    @property
    def brightest(self) -> np.float32:
        """Upper limit of the light, thresholds a cycle; its integer fits in int32."""
        return np.float32(min(LARGEST / self.model.mean, 2.0**30))

    @property
    def ratio(self) -> float:
        """Mean threshold, including its shift, over the nominal threshold."""
        return self.model.mean / self.model.threshold

    @cached_property
    def gains(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None:
        """Thresholds a cycle per unit of light, and in the dark, (rows, groups x 16) each. None if
        all pixels are nominal."""
        if self.pattern is None:
            return None
        dark = self.pattern.dark * (float(self.clock.period) / self.model.mean)
        return (
            self.padded((self.pattern.gain * self.scale).astype(np.float32)),
            self.padded(dark.astype(np.float32)),
        )

    def initial_state(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.uint64]]:
        """Charge and spike index before the first cycle, (rows, groups x 16) each."""
        charge = self.padded(first_charge(self.model, self.units, self.numbers, self.pixel_flags))
        return charge, np.zeros(charge.shape, np.uint64)

    def check(self, light: Light, start: int, cycles: int) -> None:
        """Raises ValueError if the light has another shape or does not cover the cycles."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        check_covered(light, self.clock, self.row_offsets, start, cycles, self.moves)

    def course(self, light: Light, start: int, cycles: int) -> Course:
        """Course of the light over a call, which `check` allows."""
        return course_of(
            light, self.clock, self.row_offsets, start, cycles, self._most, anchored=self._ramps
        )

    @cached_property
    def launches(self) -> LaunchCache:
        """What kernels need of the `course` of light."""
        return LaunchCache(self.course)

    def parts(self, light: Light, start: int, cycles: int) -> list[tuple[int, int]]:
        """Parts of a call that differ in how much of the light changes; see `parts_of`."""
        return parts_of(light, self.clock, self.row_offsets, start, cycles)

    @property
    def has_own(self) -> bool:
        """Whether the groups with the flag TIMING or JITTER have a course of their own."""
        return self.moves is not None or self.timing is not None

    def own_course(self, light: Light, start: int, cycles: int) -> Course:
        """Course of the light in the rows whose cycles differ, for the groups with the flag TIMING
        or JITTER, of which there are some."""
        rows = None
        if self.moves is not None:
            rows = self.moves.first, self.moves.stop
        elif self.timing is not None:
            rows = self.timing.first, self.timing.stop
        return course_of(
            light, self.clock, self.row_offsets, start, cycles, self._most, self.moves,
            None if self.moves is None else self._dark, self._ramps, rows,
        )  # fmt: skip

    def in_common(self, box: Box | None) -> bool:
        """Whether the groups with a course of their own have that of the others, in whose box all
        of them lie: the clock is not steered."""
        timing = self.timing
        if self.moves is not None or timing is None or box is None:
            return False
        return box[0] <= timing.first and timing.stop <= box[1] and box[2:] == (0, self.shape[1])

    @cached_property
    def own_launches(self) -> LaunchCache:
        """What kernels need of the `own_course` of light."""
        return LaunchCache(self.own_course)

    @cached_property
    def _dark(self) -> npt.NDArray[np.float32]:
        """A plane in which pixels gather nothing, not even dark current: below 0 it is cut off."""
        return np.full(self.shape, 0.0 if self.pattern is None else NOTHING, np.float32)

    @cached_property
    def _most(self) -> Any:
        """Upper limit of each pixel's light, in units of light."""
        if self.pattern is None:
            return float(self.brightest) / self.scale if self.scale else np.inf
        gain = np.maximum(self.pattern.gain * self.scale, 1e-300).reshape(self.shape)
        dark = self.pattern.dark.reshape(self.shape) * float(self.clock.period)
        return np.maximum(float(self.brightest) - dark / self.model.mean, 0) / gain

    def running(self, spikes: npt.NDArray[np.uint64]) -> npt.NDArray[np.float64]:
        """Threshold of the current interval of each pixel, (H W,), in mean thresholds.

        Args:
            spikes: (H W,) index of the interval, or the latest spike of a pixel that draws from
                the bank; see `FastPixels.state`.
        """
        threshold, flags = np.ones(spikes.shape), self.pixel_flags
        drawn = (flags & NOISE) != 0
        banked = (flags & BANK) != 0
        if drawn.any():  # those of the bank have the first interval in common with the others
            index = np.where(banked, np.uint64(0), spikes)[drawn]
            threshold[drawn] = current_thresholds(self.model, index, self.numbers[drawn])
        for crossing in (0, 1):
            mine = banked & (spikes > 0) & (spikes & np.uint64(1) == crossing)
            if mine.any():
                cycles = (spikes[mine] >> np.uint64(1)) - np.uint64(1)
                threshold[mine] = self.drawn(mine, cycles, crossing) / self.units.one
        return threshold

    def drawn(self, mine: npt.NDArray[Any], cycles: Any, crossing: int) -> npt.NDArray[np.int32]:
        """Thresholds that pixels draw from the bank, (n,) units; see `Bank.draw`. mine: the n
        pixels, a mask (H W,) or their places."""
        groups, lanes = (each[mine] for each in self._groups_of)
        return self.bank.draw(groups, lanes, cycles, crossing, self.model.seed)

    def fraction(
        self, charge: npt.NDArray[np.int32], spikes: npt.NDArray[np.uint64]
    ) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval, (H W,), from padded state."""
        charge, spikes = self.trimmed(charge), self.trimmed(spikes)
        flags = self.pixel_flags
        threshold = np.maximum(self.running(spikes), 1 / self.units.one)
        stored = 1 - (charge + 1.0) / (threshold * self.units.one)
        # After saturation the deficit is relative to the mean threshold.
        # A pixel with timing noise fires before or after it has reached its threshold.
        early = (flags & JITTER) != 0
        least = np.where(early | (self.model.dead > 0), -np.inf, 0.0)
        held = np.clip(stored, least, np.where(early, np.inf, 1.0))
        return np.where(flags == 0, charge.view(np.uint32) / 2.0**32, held)
