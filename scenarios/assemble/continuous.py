"""The continuous-photographing sensor that a scenario asks for."""

from __future__ import annotations

from cosim import InputError
from scenarios.assemble.camera import camera_setting, resized
from scenarios.assemble.readout import refuse_keys, with_section
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting
from sensor.continuous import ContinuousSetting, Converter, quiet_floor
from sensor.sections.continuous import ContinuousSection

__all__ = ["continuous_camera", "continuous_setting", "with_defaults"]


def with_defaults(scenario: Scenario) -> Scenario:
    """The scenario with [sensor.continuous] written out."""
    return with_section(scenario, "continuous", ContinuousSection())


def continuous_camera(scenario: Scenario) -> CameraSetting:
    """Chip, light and device as for any camera; the array as large as the scenario says.

    Raises InputError for keys that only a pixel which spikes gives a meaning.
    """
    sensor = scenario.sensor
    section = sensor.continuous or ContinuousSection()
    refuse_keys(
        "continuous",
        (
            ("reset", sensor.reset, "residual"),
            ("threshold_noise", sensor.threshold_noise, 0),
            ("capacitance", sensor.capacitance, None),
            ("dead_time", sensor.dead_time, 0),
            ("comparator_delay", sensor.comparator_delay, 0),
            ("row_skew", sensor.row_skew, 0),
        ),
        "leave it out: these pixels do not spike (sensor.continuous has keys of their own)",
    )
    return resized(camera_setting(scenario), section.width, section.height)


def continuous_setting(section: ContinuousSection, camera: CameraSetting) -> ContinuousSetting:
    """The section's sensor on the chip, clock, seed, wavelength and device of the camera; what is
    of the spike pixel alone (threshold, its noise, reset) has no meaning here.

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
