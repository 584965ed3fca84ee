"""The hardware chain with the settings of a scenario, and its row in `viform compare`: the timed
exposure that document 000 contrasts with pulse modulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.config.amounts import at_least, at_most
from cosim.light.radiometry import photons_per_lux
from cosim.run.result import Latency, Metric
from imagers.common.fixed import FixedExposure, FixedTiming
from imagers.common.kind import Comparison, Setting
from imagers.common.model import (
    ExposureRange,
    FrameFigures,
    ImagerModel,
    View,
    read_latency,
    saturation,
)
from imagers.hardware_chain.pixels import ChainPixels, Ripple, strongest_stripes
from imagers.hardware_chain.section import HardwareChainSection
from sensor.dynamic_range import (
    CONVERTERS,
    SENSORS,
    Chain,
    ConverterPart,
    Mapping,
    SensorPart,
    decibels,
)

FLOODED: Final = 1.25
"""Light over that of saturation from which a frame counts as saturated: far beyond its noise."""
FULL: Final = 0.8
"""Share of saturation that white fills."""
LONGEST: Final = 0.04
"""Longest exposure that is chosen, s."""
SHORTEST: Final = 1e-6
"""Shortest exposure of a section, s."""


@dataclass(frozen=True)
class HardwareChainModel(ImagerModel):
    """See `ImagerModel`."""

    section: HardwareChainSection

    @property
    def shape(self) -> tuple[int, int]:
        return self.section.rows, self.section.columns

    @cached_property
    def sensor(self) -> SensorPart:
        s = self.section
        if s.own_sensor is not None:
            return s.own_sensor.part()
        return next(part for part in SENSORS if part.name == s.sensor)

    @cached_property
    def adc(self) -> ConverterPart:
        """Raises InputError for a converter of more than 16 bits."""
        s = self.section
        if s.own_adc is None:
            return next(part for part in CONVERTERS if part.name == s.adc)
        if s.own_adc.bits > 16:
            raise InputError(
                "imager.own_adc.bits", "at most 16 in an imager", f"{s.own_adc.bits}", "lower it"
            )
        return s.own_adc.part()

    @cached_property
    def timing(self) -> FixedTiming:
        """Raises InputError for a clock or a frame rate that is too fast."""
        s, rate = self.section, self.adc.converter.hertz
        if s.clock > rate and s.own_adc is not None:
            raise InputError(
                "imager.own_adc.rate", f"at least {at_least(s.clock)} Hz, imager.clock",
                f"{rate:g} Hz", "raise it, or lower imager.clock",
            )  # fmt: skip
        if s.clock > rate:
            raise InputError(
                "imager.clock", f"at most {at_most(rate)} Hz with converter {self.adc.name}",
                f"{s.clock:g} Hz", "lower it, or choose another imager.adc",
            )  # fmt: skip
        return FixedTiming.of(
            self.shape, s.clock, s.exposure, s.frame_rate, blanking=s.blanking, rolling=True
        )

    @cached_property
    def pixels(self) -> ChainPixels:
        s, sensor = self.section, self.sensor
        chain = Chain(
            sensor.full_well, 0.0, sensor.sensitivity, s.circuit_noise, self.adc.converter,
            s.analog_gain, s.digital_gain,
        )  # fmt: skip
        responsivity = photons_per_lux() * (s.pitch * 1e-6) ** 2 * s.quantum_efficiency
        made = ChainPixels(
            self.shape, chain, sensor.noise, responsivity, s.temperature, s.clock,
            Ripple(s.ripple, s.ripple_frequency, self.timing), s.black, s.exposure,
        )  # fmt: skip
        if made.zero * s.digital_gain >= 1 << made.bits:
            raise InputError(
                "imager.black", f"below full scale, {(1 << made.bits) - 1}, after the digital gain",
                f"{made.zero * s.digital_gain:g} DN", "lower it, the noise or the gains",
            )  # fmt: skip
        return made

    @property
    def chain(self) -> Chain:
        """The chain of `viform design dynamic-range` with this hardware: the sensor's noise at its
        temperature, clock and exposure; the ripple adds to the circuit noise in quadrature."""
        s = self.section
        return replace(
            self.pixels.chain,
            noise=self.sensor.noise.at(s.temperature, s.clock, s.exposure),
            circuit=math.hypot(s.circuit_noise, self.pixels.ripple.rms),
        )

    @property
    def mapping(self) -> Mapping:
        return Mapping(self.section.gamma, self.section.output_bits)

    def make(self) -> FixedExposure:
        return FixedExposure(self.section.kind, self.pixels, self.timing)

    def exposures(self, view: View, stop: int) -> ExposureRange:
        seconds = float(self.timing.exposure * self.timing.clock.period)
        light = float(view.least.min()) * seconds, float(view.most.max()) * seconds
        return ExposureRange(light, (seconds, seconds), self.timing.frames(stop))

    def picture(self, values: npt.NDArray[np.uint16], bits: int) -> npt.NDArray[np.uint8]:
        """The tone-mapped picture: from darkness to saturation, by the power law of `gamma`."""
        return self.mapped(values, self.mapping)

    def mapped(self, values: npt.NDArray[np.uint16], mapping: Mapping) -> npt.NDArray[np.uint8]:
        """A frame by a mapping, its last code as 255."""
        pixels = self.pixels
        light = (values - pixels.zero * self.chain.digital) / (self.chain.saturation * pixels.slope)
        return np.rint(mapping.codes(light) * (255 / mapping.steps)).astype(np.uint8)

    def levels(
        self, values: npt.NDArray[np.uint16], bits: int, white: float
    ) -> tuple[npt.NDArray[np.int64], int]:
        """Digital numbers above darkness, with saturation as white."""
        dark = round(self.pixels.zero * self.chain.digital)
        full = max(round(self.chain.saturation * self.pixels.slope), 1)
        return np.maximum(values.astype(np.int64) - dark, 0), full

    def measured(self, frames: Sequence[FrameFigures]) -> tuple[float | None, float | None]:
        """Noise in the dark (of all values of frames without light, the ripple in it) and
        saturation (mean of flooded frames above darkness), electrons; None without such frames."""
        slope, chain = self.pixels.slope, self.chain
        flooded = FLOODED * chain.saturation / self.pixels.responsivity
        dark = [f for f in frames if f.state["light_most"] == 0]
        full = [f for f in frames if f.state["light_least"] >= flooded]
        if not dark:
            return None, None
        noise = math.sqrt(np.mean([f.spread**2 for f in dark])) / slope
        black = np.mean([f.mean for f in dark])
        return noise, float(np.mean([f.mean for f in full]) - black) / slope if full else None

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        chain = self.chain
        noise, full = self.measured(frames)
        ends = None if full is None or not noise else decibels(full / noise)
        made = {
            "dark_noise": Metric(
                noise, "e", "no dark frame, or none that saturates, to measure it"
            ),
            "dark_noise_formula": Metric(chain.floor, "e"),
            "saturation": Metric(full, "e", "no dark frame, or none that saturates, to measure it"),
            "saturation_formula": Metric(chain.saturation, "e"),
            "dynamic_range": Metric(
                ends, "dB", "no dark frame, or none that saturates, to measure it"
            ),
            "dynamic_range_formula": Metric(chain.over_noise, "dB"),
            "dynamic_range_document": Metric(chain.document, "dB"),
            "dynamic_range_mapped": Metric(
                None if ends is None else self.mapping.survives(ends),
                "dB",
                "the range is not measured",
            ),
            **saturation(frames),
        }
        if self.section.ripple:
            row, column = self.pixels.ripple.stripes()
            seen = (None,) * 3 if imager.dark is None else strongest_stripes(imager.dark)
            made |= {
                "stripes_row": Metric(seen[0], "cycles/row", "no dark frame"),
                "stripes_row_formula": Metric(row, "cycles/row"),
                "stripes_column": Metric(seen[1], "cycles/column", "no dark frame"),
                "stripes_column_formula": Metric(column, "cycles/column"),
                "stripes_amplitude": Metric(seen[2], "DN", "no dark frame"),
                "stripes_amplitude_formula": Metric(self.pixels.volts(self.section.ripple), "DN"),
            }
        return made

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        return read_latency(frames)


class HardwareChainComparison(Comparison):
    """See `Comparison`. Unless given, the sensor is the 3T one, of 10 fF and 1 V: the pixel of the
    pulse-modulated imagers that it stands beside."""

    title = "timed exposure, hardware chain"

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        return super().keys(shape) | {
            "sensor": "cmos-3t", "pitch": "10 um", "quantum_efficiency": 0.7
        }  # fmt: skip

    def adjust(
        self, section: HardwareChainSection, white: float, mean: float, given: frozenset[str]
    ) -> HardwareChainSection:
        """The exposure at which white fills a share of saturation, up to the longest."""
        if "exposure" in given:
            return section
        model = HardwareChainModel(section)
        full = FULL * model.chain.saturation / (white * model.pixels.responsivity)
        return section.model_copy(update={"exposure": max(min(full, LONGEST), SHORTEST)})

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        """Exposures from the shortest to the longest, at the gains that are set."""
        return Setting(pixels, SHORTEST), Setting(replace(pixels, exposure=LONGEST), LONGEST)

    def setting(self, section: HardwareChainSection, pixels: Any) -> str:
        name = section.sensor if section.own_sensor is None else section.own_sensor.name
        gain = math.prod((section.analog_gain, section.digital_gain))
        return f"{name}, {pixels.bits} bits, gain {gain:g}"
