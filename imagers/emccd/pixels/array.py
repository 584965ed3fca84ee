"""`EmccdPixels`: from light on the image area to 16-bit numbers, through storage and gain register.

The light of a row gives the mean of a Poisson count of electrons. Smear, dark current and
clock-induced charge are added. Charge above the image well spills along its column. Every packet is
multiplied. Charge above the register's well spills along the line. The amplifier adds its noise,
and the converter rounds to whole DN. Lux count as monochromatic light of 555 nm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Effect
from imagers.common.frame_pixel import Conversion, FixedPattern, digitised, summary_of
from imagers.emccd.pixels.chip import (
    ADC_BITS,
    CLOCK_INDUCED,
    COLUMNS,
    DARK_AT_20C,
    DARK_COLUMNS,
    DARK_ROWS,
    DSNU_SHARE,
    IMAGE_WELL,
    OFFSET,
    PITCH,
    PRNU,
    QUANTUM_EFFICIENCY,
    READ_NOISE,
    READOUT,
    REGISTER_WELL,
    ROW_SHIFT,
    ROWS,
    STAGES,
    WAVELENGTH,
    WORKING_KELVIN,
    dark_current,
)
from imagers.emccd.pixels.effects import Terms, emccd_effects
from imagers.emccd.pixels.multiplication import branch, excess_noise_squared, multiply
from imagers.emccd.pixels.wells import spill_columns, spill_lines
from sensor.frame_pixels import Exposed, ImagerSummary

Values = npt.NDArray[np.float64]

_DSNU_KIND, _PRNU_KIND = 0, 1
"""Counters of the fixed pattern's draws."""


@dataclass(frozen=True, eq=False)
class EmccdExposed(Exposed):
    """Rows of the whole image area, of which a window is read. None stands for the value of the
    pixel model.

    Attributes:
        read: (first, count) of the rows that are read; None for all.
        gain: mean gain of this frame.
        kelvin: temperature of the chip, K.
        row_shift: time of one row shift in a frame transfer, s.
    """

    read: tuple[int, int] | None = None
    gain: float | None = None
    kelvin: float | None = None
    row_shift: float | None = None


@dataclass(frozen=True)
class EmccdPixels:
    """The pixels of the chip. Defaults are the figures of the chip or of the document.

    Attributes:
        gain: mean multiplication, 1 to 1000.
        kelvin: temperature of the chip.
        tier: "exact" draws every stage (40 us a pixel), "fast" one law for all.
        row_shift: s.
        readout: s that a row waits in storage at the longest; bounds read it.
        pattern_seed: the device's.
        dark: e- / (pixel s) at 20 degC.
        image_well, register_well: e-.
        read_noise: e- RMS at the output.
    """

    gain: float = 1.0
    kelvin: float = WORKING_KELVIN
    tier: Literal["fast", "exact"] = "fast"
    stages: int = STAGES
    row_shift: float = ROW_SHIFT
    readout: float = READOUT
    pattern_seed: int = 1
    quantum_efficiency: float = QUANTUM_EFFICIENCY
    dark: float = DARK_AT_20C
    dsnu: float = DSNU_SHARE
    prnu: float = PRNU
    clock_induced: float = CLOCK_INDUCED
    image_well: float = IMAGE_WELL
    register_well: float = REGISTER_WELL
    read_noise: float = READ_NOISE
    offset: float = OFFSET
    shape: tuple[int, int] = (ROWS, COLUMNS)
    bits: int = ADC_BITS
    effects: dict[str, Effect] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.gain >= 1:
            raise ValueError(f"gain must be 1 or more, not {self.gain:g}")
        if self.tier not in ("fast", "exact"):
            raise ValueError(f"tier must be fast or exact, not {self.tier}")
        object.__setattr__(self, "effects", emccd_effects(self._terms()))

    @property
    def step(self) -> float:
        """Electrons of one DN at the output; the register's well is full scale."""
        return self.register_well / ((1 << self.bits) - 1 - self.offset)

    @property
    def responsivity(self) -> float:
        """Photoelectrons in one lux second, 9.7e5."""
        light = photons_per_lux(WAVELENGTH) * PITCH**2
        return light * self.quantum_efficiency

    def lux_seconds(self, electrons: float, seconds: float) -> float:
        """Exposure (lx s, uniform light) at which this mean number of electrons, smear and dark
        included, reaches the register: the inverse of the mean of `mean_variance`."""
        dark = dark_current(self.kelvin, self.dark) * seconds
        photo = (electrons - dark - self.clock_induced) / (1.0 + self._shifts / seconds)
        if photo < 0:
            raise ValueError(f"{electrons:g} e- must be more: the dark alone makes as many")
        return photo / self.responsivity

    @property
    def effective_read_noise(self) -> float:
        """Noise of the amplifier referred to the pixel, e- RMS: read noise over gain."""
        return self.read_noise / self.gain

    @property
    def _shifts(self) -> float:
        """Time, s, that a packet spends in the lit rows of its column except its own."""
        return (self.shape[0] - 2 * DARK_ROWS - 1) * self.row_shift

    def _terms(self) -> Terms:
        return Terms(
            excess=lambda gain: excess_noise_squared(gain, self.stages),
            dark=lambda kelvin: dark_current(kelvin, self.dark),
            dsnu=self.dsnu,
            prnu=self.prnu,
            clock_induced=self.clock_induced,
            smear=self._shifts,
            read=self.read_noise,
            readout=self.readout,
            step=self.step,
            image_well=self.image_well,
            register_well=self.register_well,
            shape=self.shape,
        )

    def _lit(self, rows: Exposed) -> npt.NDArray[np.bool_]:
        """Mask of the pixels that see light: all except the dark reference."""
        height, width = self.shape
        y = rows.first + np.arange(rows.lux_seconds.shape[0])
        x = np.arange(width)
        down = (y >= DARK_ROWS) & (y < height - DARK_ROWS)
        across = (x >= DARK_COLUMNS) & (x < width - DARK_COLUMNS)
        return down[:, None] & across

    def _smear(self, photo: Values, rows: Exposed, row_shift: float) -> Values:
        """Light that packets collect during transfer: in the first transfer from the rows behind,
        in the second from the rows before, so one row shift from every row except their own. Rows
        that are not given count with the mean of the given rows."""
        seconds = rows.seconds[:, None]
        rate = np.divide(photo, seconds, out=np.zeros_like(photo), where=seconds > 0)
        given = max(int(self._lit(rows).any(axis=1).sum()), 1)
        total = rate.sum(axis=0) * ((self.shape[0] - 2 * DARK_ROWS) / given)
        return np.maximum(total - rate, 0.0) * row_shift

    @cached_property
    def pattern(self) -> FixedPattern:
        """Fixed pattern of the device."""
        return FixedPattern(self.shape, self.pattern_seed)

    def _electrons(self, rows: Exposed, at: Conversion, kelvin: float, row_shift: float) -> Values:
        """Electrons in the storage area, before multiplication."""
        photo = np.where(self._lit(rows), rows.lux_seconds * self.responsivity, 0.0)
        photo = at.times(photo, "PRNU", lambda: self.pattern.factor(_PRNU_KIND, self.prnu))
        if "smear" in at.kept:
            photo = photo + self._smear(photo, rows, row_shift)
        photo = at.counts(photo, "shot noise", Stream.IMAGER_SHOT)
        photo = photo + at.dark_counts(
            dark_current(kelvin, self.dark), rows.seconds + rows.waiting,
            lambda: self.pattern.factor(_DSNU_KIND, self.dsnu),
        )  # fmt: skip
        if "image well overflow" in at.kept:
            spill_columns(photo, self.image_well)
        else:
            np.minimum(photo, self.image_well, out=photo)
        if "clock-induced charge" in at.kept:
            photo += at.counts(self.clock_induced, "clock-induced charge", Stream.IMAGER_CLOCKS)
        return photo

    def _multiplied(self, held: Values, at: Conversion, gain: float) -> Values:
        if "multiplication noise" not in at.kept:
            return held * gain
        if self.tier == "fast":
            return multiply(held, gain, at.numbers, at.frame, at.seed, self.stages)
        # Fractions of an electron, which only light without shot noise has, get the mean gain.
        whole = np.floor(held)
        made = branch(whole, gain, at.numbers, at.frame, at.seed, self.stages)
        return made + (held - whole) * gain

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """(rows, W) DN; of an `EmccdExposed`, the rows of its window.

        The given rows are neighbours on the chip and share charge if they overflow. The rows that
        are read pass the register one after another; it is empty before the first.
        """
        height, width = rows.lux_seconds.shape
        if width != self.shape[1] or rows.first < 0 or rows.first + height > self.shape[0]:
            raise ValueError(f"rows must lie within {self.shape}, not {height} from {rows.first}")
        special = rows if isinstance(rows, EmccdExposed) else None

        def own(given: float | None, default: float) -> float:
            return default if given is None else given

        gain = own(special.gain if special else None, self.gain)
        kelvin = own(special.kelvin if special else None, self.kelvin)
        row_shift = own(special.row_shift if special else None, self.row_shift)
        at = Conversion.of(rows, seed, kept)
        charge = self._electrons(rows, at, kelvin, row_shift)
        if special and special.read is not None:
            first, count = special.read
            if first < 0 or count < 1 or first + count > height:
                raise ValueError(f"window must lie within {height} rows, not {special.read}")
            charge, at = charge[first : first + count], at.window(first, count)
        charge = self._multiplied(charge, at, gain)
        if "register overflow" in kept:
            spill_lines(charge, self.register_well)
        else:
            np.minimum(charge, self.register_well, out=charge)
        charge = at.noisy(charge, self.read_noise, "read noise", Stream.IMAGER_READ)
        return digitised(charge / self.step + self.offset, self.bits)

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`; for uniform light, read immediately after the exposure.

        m = E[electrons]; variance (F^2 g^2 m + read^2)/step^2 + 1/12.
        """
        share = self._shifts / seconds if seconds > 0 else 0.0
        electrons = lux_seconds * self.responsivity * (1.0 + share)
        electrons += dark_current(self.kelvin, self.dark) * seconds + self.clock_induced
        excess = excess_noise_squared(self.gain, self.stages)
        power = excess * self.gain**2 * electrons + self.read_noise**2
        return (
            self.offset + electrons * self.gain / self.step,
            power / self.step**2 + 1.0 / 12.0,
        )

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`. If frames have their own gain or temperature (`EmccdExposed`), the
        caller replaces these fields by their ranges."""
        light = lux_seconds[0] * self.responsivity, lux_seconds[1] * self.responsivity
        return summary_of(
            light, seconds, frames, self.image_well, kelvin=self.kelvin,
            gain=(self.gain, self.gain), step=self.step,
        )  # fmt: skip
