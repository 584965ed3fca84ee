"""The frame-transfer EMCCD with the settings of a scenario; its row in `viform compare`, where
exposure and gain are set for the light, and its part in `viform laboratory`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS, seconds_to_ps
from cosim.frames import Frame
from cosim.run.result import Latency, Metric
from imagers.common.kind import Comparison, Setting
from imagers.common.model import (
    ExposureRange,
    FrameFigures,
    ImagerModel,
    View,
    saturation,
    write_all,
)
from imagers.emccd.device.cooling import Cooler
from imagers.emccd.device.imager import Emccd
from imagers.emccd.device.sine_drive import DriveSettings, SineDrive
from imagers.emccd.device.supplies import Course, Supplies
from imagers.emccd.device.timing import CLOCK_HZ, Settings, Timing, exposure_range, frame_seconds
from imagers.emccd.electronics import drive_metrics, supply_metrics
from imagers.emccd.pixels import (
    GAIN_RANGE,
    EmccdPixels,
    HighVoltage,
    excess_noise_squared,
    without_smear,
)
from imagers.emccd.pixels.chip import DARK_ROWS, PITCH
from imagers.emccd.section import EmccdSection
from sensor.frame_pixels import PixelModel
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera

STEP: Final = 1e-5
"""Step of the exposure, s."""
WARM: Final = 600 * PS
"""Time from power-on of the cooling to the start of a run, ps."""
KELVIN: Final = 273.15
FULL: Final = 0.8
"""Share of a well that white fills."""
COLUMNS: Final = 512
"""Columns of the image area."""
LONGEST: Final = 4096 * STEP
"""Longest exposure, s."""


@dataclass(frozen=True)
class EmccdModel(ImagerModel):
    """See `ImagerModel`.

    Attributes:
        section: section of the scenario.
        seconds: duration of the run, s, in which pulses of external sync arrive.
    """

    section: EmccdSection
    seconds: float

    @cached_property
    def pixels(self) -> EmccdPixels:
        s = self.section
        pixels = EmccdPixels(kelvin=s.temperature + KELVIN, pattern_seed=s.device_seed)
        return replace(pixels, gain=self.drive.gain(self.step))

    @cached_property
    def voltage(self) -> HighVoltage:
        return HighVoltage(ageing=self.section.ageing)

    @cached_property
    def drive(self) -> SineDrive:
        """The high-voltage drive; its transformer is as warm as the camera's body."""
        s = self.section
        return SineDrive(self.voltage, DriveSettings(**dict(s.drive)), CLOCK_HZ, s.ambient)

    @cached_property
    def supplies(self) -> Supplies:
        s = self.section.supplies
        return Supplies(s.order, s.ramp, s.delay, s.failed)

    @cached_property
    def power_up(self) -> Course:
        """The supplies from their switch-on until they are good, or down again."""
        return self.supplies.run()

    @property
    def powered(self) -> tuple[int, int | None]:
        """Instants at which the supplies are good and at which they are switched off, ps."""
        s, good = self.section.supplies, self.power_up.good
        if good is None:
            return 0, 0
        start = 0 if s.on is None else seconds_to_ps(s.on + good)
        return start, None if s.off is None else seconds_to_ps(s.off)

    @property
    def step(self) -> int:
        """Step of the potentiometer."""
        s = self.section
        if s.gain_step is not None:
            return s.gain_step
        curve = self.voltage if s.calibrated else HighVoltage()
        return 0 if s.gain is None else curve.step_for(s.gain)

    @property
    def shape(self) -> tuple[int, int]:
        return self.pixels.shape

    def make(self) -> Emccd:
        s = self.section
        pulses = [seconds_to_ps(p) for p in s.pulses]
        if s.pulse_rate is not None:
            period = PS / s.pulse_rate
            pulses = [round(n * period) for n in range(int(self.seconds * s.pulse_rate) + 1)]
        cooler = cooler_of(s)
        cooler.advance(WARM)
        imager = Emccd(
            self.pixels, drive=self.drive, pulses=pulses, cooler=cooler, powered=self.powered
        )
        imager.write("emccd_exposure", max(round(s.exposure / STEP), 1))
        imager.write("emccd_gain", self.step)
        imager.write("emccd_first_row", s.first_row)
        imager.write("emccd_rows", s.rows)
        imager.write("emccd_sync", int(s.sync == "external"))
        write_all(imager, s.writes)
        return imager

    def first_row(self, state: Mapping[str, float]) -> int:
        return DARK_ROWS + int(state["first_row"])

    def _written(self, register: str) -> list[int]:
        return [v for _, name, v in self.section.writes if name.removeprefix("emccd_") == register]

    def settings(self, pixels: PixelModel) -> Sequence[PixelModel]:
        """The pixels at every gain that the run sets."""
        assert isinstance(pixels, EmccdPixels)
        steps = sorted({self.step, *(v for v in self._written("gain") if v < 256)})
        return [replace(pixels, gain=self.drive.gain(step)) for step in steps]

    def exposures(self, view: View, stop: int) -> ExposureRange:
        """Limits of all exposures that the run sets, and the number of frames that follows from the
        sequence of writes. A write does not change a running cycle."""
        s, timing = self.section, Timing()
        steps = [max(round(s.exposure / STEP), 1), *(v for v in self._written("exposure") if v)]
        span = min(steps) * STEP, max(steps) * STEP
        light = float(view.least.min()) * span[0], float(view.most.max()) * span[1]
        return ExposureRange(light, span, self._frames(timing, stop))

    def _frames(self, timing: Timing, stop: int) -> int:
        s, (start, off) = self.section, self.powered
        stop = stop if off is None else min(stop, off)
        now, frames, pending = start / PS, 0, list(s.writes)
        at = {
            "exposure": max(round(s.exposure / STEP), 1), "first_row": s.first_row,
            "rows": s.rows, "sync": int(s.sync == "external"),
        }  # fmt: skip
        rate = s.pulse_rate
        while now * PS < stop and frames < 10_000_000:
            while pending and pending[0][0] <= now:
                _, name, value = pending.pop(0)
                at[name.removeprefix("emccd_")] = value
            settings = Settings(at["exposure"], at["first_row"], at["rows"]).within(timing)
            spent = frame_seconds(timing, settings)
            if at["sync"]:
                later = [p for p in s.pulses if p >= now]
                if rate is not None:
                    now = np.ceil(now * rate) / rate
                elif later:
                    now = later[0]
                else:
                    now = min((w[0] for w in pending), default=np.inf)
                    continue
            now += spent
            frames += now * PS <= stop
        return int(frames)

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        timing = Timing()
        rates = [timing.clock_hz / t.state["frame_clocks"] for t in frames]
        gains = [t.state["gain"] for t in frames]
        last = frames[-1]
        celsius = [t.state["kelvin"] - KELVIN for t in frames]
        excess = excess_noise_squared(last.state["gain"], self.pixels.stages)
        return {
            "cycle_rate_slowest": Metric(min(rates), "Hz"),
            "cycle_rate_fastest": Metric(max(rates), "Hz"),
            "gain": Metric(last.state["gain"], "1"),
            "gain_largest": Metric(max(gains), "1"),
            "excess_noise_squared": Metric(excess, "1"),
            "effective_read_noise": Metric(self.pixels.read_noise / last.state["gain"], "e"),
            "temperature": Metric(float(np.mean(celsius)), "degC"),
            "temperature_spread": Metric(float(np.std(celsius)), "K"),
            **saturation(frames),
            "pulses_lost": Metric(float(imager.read("emccd_pulses_lost")), "1"),
            **drive_metrics(self.drive, last.state["peak"], imager.potentiometer),
            **supply_metrics(self.power_up, frames[0].begin, self.section.supplies.on),
        }

    def faults(self, imager: Any) -> list[str]:
        """See `ImagerModel`: a supply that did not come up."""
        rail = self.power_up.fault
        return [] if rail is None else [f"the rail {rail} did not come up: all are off, no frame"]

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        """Latencies from the start of exposure to the last pixel read, and from each write to the
        first frame that was exposed with it."""
        spans = [(t.ready - t.begin) * 1e-6 for t in frames]
        rows = [_row("exposure's beginning to the frame read", spans)]
        waits = []
        for seconds in sorted({w[0] for w in self.section.writes}):
            ps = seconds_to_ps(seconds)
            later = [t for t in frames if _began(t) > ps]
            if later:
                waits.append((later[0].ready - ps) * 1e-6)
        return [*rows, *([_row("register write to the first frame of it", waits)] if waits else [])]


def cooler_of(section: EmccdSection) -> Cooler:
    """The cooler at power-on, at ambient temperature."""
    air, target = section.ambient + KELVIN, section.temperature + KELVIN
    return Cooler(lambda _: air, target)


def _began(frame: FrameFigures) -> int:
    """Instant at which the cycle of a frame took its parameters, ps: one frame transfer before the
    exposure."""
    timing = Timing()
    return frame.begin - timing.rows * timing.transfer * PS // timing.clock_hz


def _row(stage: str, spans: list[float]) -> Latency:
    return Latency(stage, min(spans), float(np.median(spans)), max(spans))


class EmccdComparison(Comparison):
    """See `Comparison`."""

    title = "EMCCD"
    note = "middle of its 512 x 512, dark around"

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        return {}

    def adjust(
        self, section: EmccdSection, white: float, mean: float, given: frozenset[str]
    ) -> EmccdSection:
        """Chooses the exposure at which white fills a share of the image well, up to the longest.
        In dim light, chooses the gain that brings the noise of the amplifier below the shot noise
        of mid-grey."""
        pixels = EmccdPixels()
        exposure = section.exposure
        if "exposure" not in given:
            full = FULL * pixels.image_well / (white * pixels.responsivity)
            exposure = max(math.floor(min(full, LONGEST) / STEP), 1) * STEP
        changed: dict[str, float] = {"exposure": exposure}
        if not given & {"gain", "gain_step"}:
            electrons = white * pixels.responsivity * exposure
            needed = 3 * pixels.read_noise / math.sqrt(max(electrons / 2, 1e-6))
            room = FULL * pixels.register_well / max(electrons, 1e-6)
            changed["gain"] = min(max(min(needed, room), GAIN_RANGE[0]), GAIN_RANGE[1])
        return section.model_copy(update=changed)

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        shortest, longest = exposure_range()[:2]
        low, high = (EmccdPixels(gain=gain) for gain in GAIN_RANGE)
        return Setting(low, shortest), Setting(high, longest)

    def sent(self, section: EmccdSection) -> int:
        return section.rows * COLUMNS

    def setting(self, section: EmccdSection, pixels: Any) -> str:
        return f"gain {pixels.gain:.3g}"

    def first_row(self, frame: Frame) -> int:
        return DARK_ROWS + int(frame.state["first_row"])

    def without_smear(
        self, signal: npt.NDArray[np.float64], imager: Any, seconds: float
    ) -> npt.NDArray[np.float64] | None:
        return without_smear(signal, imager.timing.row_shift / seconds)


def _bench(seed: int) -> Bench:
    """Without multiplication; rows and columns of the image area."""
    pixels = EmccdPixels(gain=1.0, shape=(48, 88))
    return Bench(
        pixels, PITCH**2, 0.01, (0.01, 2, 4), rows=32, first=8, columns=(12, 64),
        levels=10, frames=6, stack=24, seed=seed, kept=frozenset(pixels.effects) - {"smear"},
    )  # fmt: skip


MEASURED: Final = Camera(
    "emccd", "EMCCD, gain 1", _bench,
    ("no multiplication and no smear: the parameters are those of the chip",),
)  # fmt: skip
"""Its part in `viform laboratory`."""
