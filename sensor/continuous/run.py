"""A continuous camera from its section, before its run, and what is left of the run for its
report.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosim import InputError, Intensities, Lens, Light
from cosim.light.source import Source
from cosim.run.machine import Run
from sensor.continuous.core import IntensityCamera
from sensor.continuous.plan import IntensityPlan
from sensor.continuous.setting import ContinuousSetting, Converter, quiet_floor
from sensor.continuous.shots import ContinuousShot, PixelLight, effect_names
from sensor.latched.setting import CameraSetting
from sensor.sections.sensor import SensorSection
from sensor.sections.unlatched import ContinuousSection

STREAM: Final = "stream.intensities.npz"
"""The reports' name in a run's folder."""


@dataclass(frozen=True, eq=False)
class ContinuousSpec:
    """A continuous camera before a scene.

    Attributes:
        name, title: short and long name of the scenario.
        toml: the resolved scenario.
        inputs: the same without its title, which decides nothing of the result.
        section: section of the sensor, as the user wrote it.
        camera: chip, light and device.
        pixels: the pixels, ready to be called.
        lens: lens in front of the chip.
        relay: map from the scene's light to what each pixel receives.
        illuminance: illuminance of the scene, lux; white reflects all of it.
        source: scene.
        cycles: length of the run.
        instants: cycles whose images are made.
    """

    name: str
    title: str
    toml: str
    inputs: str
    section: SensorSection
    camera: CameraSetting
    pixels: IntensityCamera
    lens: Lens
    relay: Callable[[Light], Light]
    illuminance: float
    source: Source
    cycles: int
    instants: list[int]

    @property
    def setting(self) -> ContinuousSetting:
        """The setting of the pixels."""
        return self.pixels.setting

    @property
    def white(self) -> float:
        """Photocurrent of white, electrons/s."""
        return self.illuminance * self.lens.gain * self.setting.electrons_per_lux


@dataclass(frozen=True, eq=False)
class ContinuousViews:
    """What is made of a recording.

    Attributes:
        reports: all of them.
        light: light of the pixels that are drawn.
        shots: images at the instants.
    """

    reports: Intensities
    light: PixelLight
    shots: list[ContinuousShot]


@dataclass(frozen=True, eq=False)
class ContinuousRun:
    """A judged run, as its page reads it.

    Attributes:
        run: result, wall times and notes.
        spec: camera and scene.
        plan: what was kept and left out.
        views: what was made of the recording.
    """

    run: Run
    spec: ContinuousSpec
    plan: IntensityPlan
    views: ContinuousViews


def continuous_setting(section: ContinuousSection, camera: CameraSetting) -> ContinuousSetting:
    """The section's pixels on the chip, clock, seed, wavelength and device of the camera. What
    belongs to a spiking pixel alone (threshold, its noise, reset) has no meaning here.

    Raises InputError for values that do not go together.
    """
    place = "sensor.continuous"
    if section.exponent_bits >= section.bits:
        raise InputError(
            f"{place}.exponent_bits", f"below {place}.bits = {section.bits}",
            str(section.exponent_bits), "lower it",
        )  # fmt: skip
    if section.floor is None and section.contrast == 0:
        raise InputError(
            f"{place}.floor", "given where contrast is 0", "absent",
            f"write --set {place}.floor='1e6 e/s'",
        )  # fmt: skip
    if camera.pattern is not None and camera.pattern.threshold_fpn > 0:
        raise InputError(
            "sensor.pattern.threshold_fpn", "0 where there is no charge threshold",
            f"{camera.pattern.threshold_fpn:g}", "leave it out",
        )  # fmt: skip
    floor = section.floor
    return ContinuousSetting(
        camera.chip,
        camera.clock,
        camera.seed,
        section.time_constant,
        section.contrast,
        quiet_floor(section.contrast, section.time_constant) if floor is None else floor,
        Converter(section.bits, section.exponent_bits, section.full_scale),
        section.measure,
        section.dead_time,
        section.shot_noise,
        camera.wavelength_nm,
        camera.pattern,
    )


def intensity_camera(
    section: ContinuousSection, camera: CameraSetting, tolerance: float, window: int,
    floor: float | None,
) -> IntensityCamera:  # fmt: skip
    """The camera, ready to be called.

    Args:
        section, camera: see `continuous_setting`, which also says what raises InputError.
        tolerance: allowed relative error.
        window: cycles of an image.
        floor: spikes a cycle of a spike camera to which errors of darker tiles are relative; None
            for a spike in the window, 0 for the least change that is reported.
    """
    setting = continuous_setting(section, camera)
    names = tuple(effect_names(setting, camera))
    rate = 1 / window if floor is None else floor
    return IntensityCamera(
        setting, names, tolerance=tolerance, most=section.most_reports, window=window,
        floor=rate * camera.threshold * setting.clock.hz or None,
    )  # fmt: skip
