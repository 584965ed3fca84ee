"""The pixels of a [sensor.continuous] section."""

from __future__ import annotations

from cosim import InputError
from sensor.continuous.converter import Converter
from sensor.continuous.core import IntensityCamera
from sensor.continuous.setting import ContinuousSetting, quiet_floor
from sensor.continuous.shots import effect_names
from sensor.latched.setting import CameraSetting
from sensor.sections.continuous import ContinuousSection


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
    section: ContinuousSection, camera: CameraSetting, tolerance: float
) -> IntensityCamera:
    """The camera, ready to be called. camera, and raises: see `continuous_setting`."""
    setting = continuous_setting(section, camera)
    kept = tuple(effect_names(setting, camera))
    return IntensityCamera(setting, kept, tolerance=tolerance, most=section.most_reports)
