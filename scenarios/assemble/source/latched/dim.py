"""Dim pixels of a latched camera: readings below threshold and rejection of the dark, their limits
in a scenario, and how the images of a run have them; and what the chip of a recorded run says
beyond its spikes, which a display or a link that plays it again follows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import Block, InputError, SpikeStream, Viform
from cosim.config.amounts import amount
from cosim.config.toml import read_toml
from cosim.run.result import Metric
from cosim.spikes.ancillary import Ancillary
from cosim.spikes.staged import StreamStage
from cosim.stage import BLOCK, Stage, blocks
from sensor import CameraSetting, SpikeCamera
from sensor.dynamic_range import (
    dark_limit,
    longest_width,
    seen_dark_share,
    spike_dynamic_range,
)
from sensor.latched.ancillary import MOST_DARK, AncillaryStage, registers_of
from sensor.latched.reading import ReadingCamera
from sensor.latched.writes import Registers
from sensor.reconstruct.readings import (
    READINGS,
    DimLight,
    Readings,
    read_readings,
    write_readings,
)
from sensor.reconstruct.shots import Shot
from sensor.sections.sensor import DarkMargin, SensorSection

_MOST: Final = 2**31
"""Readings of single pixels that a run may take; they are kept in memory, two bytes each."""
_KEY: Final = "sensor.sub_threshold.limit"
_SCENARIO: Final = "scenario.toml"


def check_dim(section: SensorSection, setting: CameraSetting, cycles: int) -> None:
    """Raises InputError for readings or a dark limit that a run of so many cycles cannot have."""
    dark_cycles(section, setting)
    if section.sub_threshold is None:
        return
    every, hertz = cycles_between(section, setting), setting.clock.hz
    if not 1 <= every <= cycles:
        least, most = amount(1 / hertz, "s"), amount(cycles / hertz, "s")
        raise InputError(
            _KEY, f"{least} to {most}, one cycle to the run",
            repr(amount(section.sub_threshold.limit, "s")),
            "shorten it, or lengthen duration" if every else "lengthen it, or raise sensor.clock",
        )  # fmt: skip
    readings, pixels = cycles // every + 1, setting.chip.height * setting.chip.width
    if readings * pixels > _MOST:
        raise InputError(
            _KEY, f"so long that {_MOST // pixels} readings are enough", f"{readings} readings",
            "lengthen it, or shorten duration",
        )  # fmt: skip


def cycles_between(section: SensorSection, setting: CameraSetting) -> int:
    """Cycles between two readings."""
    assert section.sub_threshold is not None
    return round(section.sub_threshold.limit * setting.clock.hz)


def dark_cycles(section: SensorSection, setting: CameraSetting) -> float:
    """Width in cycles from which on an interval is rejected; infinite for none. Raises InputError
    if the device whose dark current decides has none, or too much noise for the margin."""
    limit = section.dark_limit
    if limit is None:
        return math.inf
    if not isinstance(limit, DarkMargin):
        return float(limit * setting.clock.hz)
    written = section.model_dump(mode="json")["dark_limit"]
    law = _law_of_the_dark(setting)
    if law is None:
        raise InputError(
            "sensor.pattern.dark_current", f"above 0 with sensor.dark_limit = '{written}'",
            "0 e/s", "give it, or a duration as sensor.dark_limit",
        )  # fmt: skip
    width, noise, pattern = law
    if limit.percent:
        cycles: float = dark_limit(limit.percent / 100, width, noise, pattern)
    else:
        cycles = width * (1 - limit.sigmas * math.hypot(noise, pattern))
        cycles = math.floor(cycles) if limit.sigmas else cycles
    if cycles < 2 and any(limit):
        raise InputError(
            "sensor.dark_limit", f"a margin that leaves 2 of the {width:.3g} cycles of a width in "
            f"the dark, whose standard deviation is {math.hypot(noise, pattern):.2g} of it",
            repr(written), "take a smaller margin, or a duration",
        )  # fmt: skip
    return cycles


def rejected_from(section: SensorSection, setting: CameraSetting) -> int:
    """Whole cycles from which on an interval is rejected, for a display; 0 for never in a run."""
    return whole_dark(dark_cycles(section, setting))


def whole_dark(cycles: float) -> int:
    """A width as whole cycles, see `rejected_from`."""
    return math.ceil(cycles) if cycles <= MOST_DARK else 0


def _law_of_the_dark(setting: CameraSetting) -> tuple[float, float, float] | None:
    """Mean width in the dark, cycles, and its relative standard deviations: of a pixel's widths,
    and of the pixels' dark currents over their thresholds. None without a dark current."""
    pattern = setting.pattern
    if pattern is None or not pattern.dark:
        return None
    width = longest_width(setting.threshold, pattern.dark) * setting.clock.hz
    return width, setting.spread, math.hypot(pattern.dsnu, pattern.threshold_fpn)


def reading_camera(
    camera: SpikeCamera, sensor: SensorSection, setting: CameraSetting
) -> SpikeCamera | ReadingCamera:
    """The camera of a run, which also reads the charge if the scenario has it do so."""
    section = sensor.sub_threshold
    if section is None:
        return camera
    every = cycles_between(sensor, setting)
    return ReadingCamera(camera, setting, every, section.levels)


def dim_light(
    sensor: SensorSection, setting: CameraSetting, camera: Any, folder: Path
) -> tuple[DimLight | None, list[str]]:
    """How the images of a run have dim pixels, None for from spikes alone; and the names of the
    files that this writes into the folder."""
    readings = camera.readings() if isinstance(camera, ReadingCamera) else None
    dark = dark_cycles(sensor, setting)
    if readings is None:
        return (DimLight(dark=dark) if math.isfinite(dark) else None), []
    write_readings(readings, folder / READINGS)
    return DimLight(readings, dark), [READINGS]


def dim_range(sensor: SensorSection, setting: CameraSetting) -> float | None:
    """Dynamic range with readings, dB: 20 lg(limit / cycle N); None without them."""
    if sensor.sub_threshold is None:
        return None
    return spike_dynamic_range(cycles_between(sensor, setting), 1, sensor.sub_threshold.levels)


def dim_metrics(
    sensor: SensorSection, setting: CameraSetting, shots: list[Shot]
) -> dict[str, Metric]:
    """Pixels that are read and rejected, mean over the images."""
    masks = [shot.dim for shot in shots if shot.dim is not None]
    metrics: dict[str, Metric] = {}
    if masks and sensor.sub_threshold is not None:
        read = float(np.mean([dim.read.sum() for dim in masks]))
        metrics["sub_threshold_pixels"] = Metric(read, "pixels")
        metrics["dynamic_range_formula"] = Metric(dim_range(sensor, setting), "dB")
    if masks and sensor.dark_limit is not None:
        dark = float(np.mean([dim.dark.sum() for dim in masks]))
        metrics["dark_pixels"] = Metric(dark, "pixels")
        limit, law = dark_cycles(sensor, setting), _law_of_the_dark(setting)
        metrics["dark_limit"] = Metric(limit / setting.clock.hz, "s")
        if law is not None:
            metrics["dark_seen_share"] = Metric(seen_dark_share(math.ceil(limit), *law), "1")
    return metrics


def dim_of_run(folder: Path) -> DimLight | None:
    """The readings and the dark limit of the run in a folder; None without either, and for what is
    no folder of a run. Raises InputError for files that the run did not write so."""
    readings = read_readings(folder / READINGS) if (folder / READINGS).exists() else None
    dark = _dark_cycles(folder / _SCENARIO)
    if readings is None and math.isinf(dark):
        return None
    return DimLight(readings, dark)


def _dark_cycles(path: Path) -> float:
    """Width in cycles from which on the run rejects an interval; infinite for none."""
    found = _camera_of(path, ("dark_limit",))
    return math.inf if found is None else dark_cycles(*found)


def _camera_of(path: Path, keys: tuple[str, ...]) -> tuple[SensorSection, CameraSetting] | None:
    """The camera of the scenario of a run, if it has one of these keys of [sensor]."""
    try:
        data = read_toml(path)
    except (OSError, ValueError):  # a stream may lie in any folder
        return None
    if not any(key in data.get("sensor", {}) for key in keys):
        return None
    from scenarios.assemble.chip import camera_setting
    from scenarios.assemble.schema.loading import filmed, load

    scenario = filmed(load(str(path))[1], "image")
    return scenario.sensor, camera_setting(scenario)


@dataclass(frozen=True, eq=False)
class Said:
    """What the chip of a recorded run says beyond its spikes.

    Attributes:
        setting: the camera.
        readings: readings below threshold; None for none.
        dark: width in cycles from which on an interval is rejected; infinite for none.
    """

    setting: CameraSetting
    readings: Readings | None
    dark: float

    def stage(self, shape: tuple[int, int]) -> AncillaryStage:
        """The stage that adds it to the recording."""
        setting = self.setting
        return AncillaryStage(shape, setting.phases, setting.threshold, self.readings, self.dark)

    @property
    def panel(self) -> dict[str, Any]:
        """Fields of the `SpikePanel` that shows it."""
        return {"dark": whole_dark(self.dark), "residues": self.readings is not None}

    def told(self, stream: SpikeStream) -> tuple[Ancillary, ...]:
        """What is said in the whole of the recording, without what is rejected."""
        setting = self.setting
        stage = AncillaryStage(
            stream.shape, setting.phases, setting.threshold, self.readings, math.inf
        )
        source = StreamStage(stream)
        planes = (
            stage.step(source.step(None, block), block) for block in blocks(stream.cycles, BLOCK)
        )
        return tuple(each for part in planes for each in part.ancillary)

    def after(self, source: Stage, shape: tuple[int, int]) -> Following:
        """The stage that makes the recording, with what is said."""
        return Following(source, self.stage(shape), shape)


@dataclass(frozen=True, eq=False)
class Following:
    """A source of planes and a stage that follows it, as one. shape: (height, width)."""

    source: Stage
    stage: Stage
    shape: tuple[int, int]

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block; `data` is not used."""
        made: Viform = self.stage.step(self.source.step(None, block), block)
        return made


def said_by_run(folder: Path) -> Said | None:
    """What the chip of the run in a folder says beyond its spikes; None for nothing, and for what
    is no folder of a run with a latched camera."""
    found = _camera_of(folder / _SCENARIO, ("writes", "sub_threshold", "dark_limit"))
    if found is None:
        return None
    readings = read_readings(folder / READINGS) if (folder / READINGS).exists() else None
    if readings is not None and not readings.every:  # a run of less than the time between two
        readings = None
    return Said(found[1], readings, dark_cycles(*found))


def registers_in(stream: SpikeStream, path: Path | None) -> Registers | None:
    """Thresholds and windows that are written in a stream; None for none. path: its file, or the
    folder of its run; None for a stream in memory."""
    said = None if path is None else said_by_run(path)
    if said is not None:
        return said.setting.registers
    told, start = getattr(stream, "ancillary", ()), int(getattr(stream, "start", 0))
    return registers_of(told, stream.shape[0], start)
